#include "daemon/files/text_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/magic.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <optional>

#include "daemon/files/descriptor.h"
#include "fleet/files/foreign_format.h"

namespace focalfleet {
namespace {

/// Length of the UTF-8 sequence that begins at `at`, 0 where none does.
std::size_t SequenceLength(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0u;
  };
  const unsigned first = byte(at);
  if (first != 0 && first < 0x80) return 1;
  const std::size_t length = first >= 0xC2 && first < 0xE0   ? 2
                             : first >= 0xE0 && first < 0xF0 ? 3
                             : first >= 0xF0 && first < 0xF5 ? 4
                                                             : 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(at + i) & 0xC0u) != 0x80) return 0;
  }
  const unsigned second = byte(at + 1);
  const bool overlong = (first == 0xE0 && second < 0xA0) || (first == 0xF0 && second < 0x90);
  const bool beyond = (first == 0xED && second >= 0xA0) || (first == 0xF4 && second >= 0x90);
  return overlong || beyond ? 0 : length;
}

std::optional<std::size_t> FirstNonText(std::string_view text) {
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t length = SequenceLength(text, at);
    if (length == 0) return at;
    at += length;
  }
  return std::nullopt;
}

// A pipe of the shell, <(command), has a writer, so the read waits for it. A named pipe in a folder
// may never have one.
Status ReadWithWaiting(int fd, const std::string& path) {
  struct stat status {};
  struct statfs system {};
  if (fstat(fd, &status) == 0 && S_ISFIFO(status.st_mode) && fstatfs(fd, &system) == 0 &&
      system.f_type != PIPEFS_MAGIC) {
    return Fail(ErrorCode::kInvalid,
                fmt::format("{}: a named pipe; give a file, or /dev/stdin", path));
  }
  fcntl(fd, F_SETFL, fcntl(fd, F_GETFL) & ~O_NONBLOCK);
  return {};
}

Status WriteDirectly(const std::string& path, const std::string& text) {
  const Descriptor file(open(path.c_str(), O_WRONLY | O_CLOEXEC));
  if (file.get() < 0) return FailErrno(path, "cannot be written", errno);
  if (const int error = WriteAll(file.get(), text)) {
    return FailErrno(path, "cannot be written", error);
  }
  return {};
}

}  // namespace

tl::unexpected<Error> FailErrno(const std::string& path, const char* what, int error) {
  const bool full = error == ENOSPC || error == EDQUOT || error == EFBIG;
  return Fail(full ? ErrorCode::kFull : ErrorCode::kUnavailable,
              fmt::format("{}: {}: {}", path, what, std::strerror(error)));
}

int WriteAll(int fd, std::string_view text) {
  while (!text.empty()) {
    const ssize_t n = write(fd, text.data(), text.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    text.remove_prefix(static_cast<std::size_t>(n));
  }
  return 0;
}

tl::expected<std::string, int> ReadAll(int fd, std::size_t bytes_max) {
  std::string bytes;
  for (;;) {
    constexpr std::size_t kChunk = 1u << 20;
    const std::size_t had = bytes.size();
    bytes.resize(had + kChunk);
    const ssize_t n = read(fd, bytes.data() + had, kChunk);
    const int error = n < 0 ? errno : 0;
    bytes.resize(had + (n > 0 ? static_cast<std::size_t>(n) : 0));
    if (error == EINTR) continue;
    if (error != 0) return tl::unexpected<int>(error);
    if (n == 0) return bytes;
    if (bytes.size() > bytes_max) return tl::unexpected<int>(EFBIG);
  }
}

Result<std::string> ReadFile(const std::string& path) {
  // The open call does not wait for a writer, which may never come. The file /dev/stdin is not
  // opened anew: its data may be half read, or a socket.
  const Descriptor file(path == "/dev/stdin"
                            ? fcntl(STDIN_FILENO, F_DUPFD_CLOEXEC, 0)
                            : open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (file.get() < 0) return FailErrno(path, "cannot be read", errno);
  if (path != "/dev/stdin") FOCALFLEET_TRY(ReadWithWaiting(file.get(), path));
  auto bytes = ReadAll(file.get(), kFileBytesMax);
  if (bytes) return std::move(*bytes);
  if (bytes.error() == EFBIG) {
    return Fail(ErrorCode::kInvalid, fmt::format("{}: larger than {} MiB, so not one of our files",
                                                 path, kFileBytesMax >> 20));
  }
  return FailErrno(path, "cannot be read", bytes.error());
}

Status CheckText(std::string_view text, const std::string& path) {
  if (const auto format = ForeignFormat(text))
    return Fail(ErrorCode::kInvalid, fmt::format("{}: this is {}", path, *format));
  if (const auto at = FirstNonText(text)) {
    std::size_t row = 1;
    for (std::size_t i = 0; i < *at; ++i) row += text[i] == '\n' ? 1u : 0u;
    return Fail(
        ErrorCode::kInvalid,
        fmt::format("{}:{}: not a text file: byte 0x{:02x} at offset {}; a CSV file in UTF-8 "
                    "is wanted",
                    path, row, static_cast<unsigned char>(text[*at]), *at));
  }
  return {};
}

Result<std::string> ReadTextFile(const std::string& path) {
  FOCALFLEET_TRY_ASSIGN(std::string text, ReadFile(path));
  FOCALFLEET_TRY(CheckText(text, path));
  return text;
}

Status WriteFileAtomically(const std::string& path, const std::string& text) {
  if (path == "-") {
    if (const int error = WriteAll(STDOUT_FILENO, text)) {
      return FailErrno("standard output", "cannot be written", error);
    }
    return {};
  }
  struct stat status {};
  const bool exists = stat(path.c_str(), &status) == 0;
  if (exists && !S_ISREG(status.st_mode)) return WriteDirectly(path, text);
  // A symbolic link is kept: the file that it points to is replaced.
  std::string place = path;
  char resolved[PATH_MAX];
  if (exists && realpath(path.c_str(), resolved) != nullptr) place = resolved;

  const std::string beside = fmt::format("{}.{}.tmp", place, getpid());
  const Descriptor file(open(beside.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                             exists ? status.st_mode & 07777 : 0666));
  if (file.get() < 0) return FailErrno(path, "cannot be written", errno);
  int error = WriteAll(file.get(), text);
  if (error == 0 && fsync(file.get()) != 0) error = errno;
  if (error == 0 && rename(beside.c_str(), place.c_str()) != 0) error = errno;
  if (error != 0) {
    unlink(beside.c_str());
    return FailErrno(path, "cannot be written", error);
  }
  return {};
}

}  // namespace focalfleet
