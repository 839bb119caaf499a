#include "daemon/files/guarded_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <system_error>

#include "daemon/files/text_file.h"

namespace focalfleet {
namespace {

constexpr std::size_t kNameMax = 255;
constexpr int kNamesTried = 10;
// A camera that counts from 1 anew each night has this many files of one name in three years.
// Looking for a free name costs a microsecond for each.
constexpr int kEqualNames = 1000;

bool IsOneName(const std::string& name) {
  return !name.empty() && name != "." && name != ".." && name.size() <= kNameMax &&
         name.find('/') == std::string::npos && name.find('\0') == std::string::npos;
}

// Opens `name` in the folder; -1 with errno on failure.
int OpenAt(int folder, const std::string& name, int flags, mode_t mode = 0) {
  if (!IsOneName(name)) {
    errno = EINVAL;
    return -1;
  }
  flags |= O_CLOEXEC | O_NOFOLLOW;
  open_how how{};
  how.flags = static_cast<unsigned>(flags);
  how.mode = mode;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_SYMLINKS;
  const long fd = syscall(SYS_openat2, folder, name.c_str(), &how, sizeof how);
  // An old kernel has no such call, and an old sandbox forbids it. For a single name O_NOFOLLOW is
  // enough.
  if (fd >= 0 || (errno != ENOSYS && errno != EPERM)) return static_cast<int>(fd);
  return openat(folder, name.c_str(), flags, mode);
}

// The kind of file as text; null: a regular file.
const char* OtherKind(mode_t mode) {
  switch (mode & S_IFMT) {
    case S_IFREG:
      return nullptr;
    case S_IFLNK:
      return "a symbolic link";
    case S_IFIFO:
      return "a named pipe";
    case S_IFSOCK:
      return "a socket";
    case S_IFDIR:
      return "a folder";
    case S_IFCHR:
    case S_IFBLK:
      return "a device";
    default:
      return "no file";
  }
}

bool IsUnchanged(const struct stat& before, const struct stat& after) {
  return before.st_size == after.st_size && before.st_mtim.tv_sec == after.st_mtim.tv_sec &&
         before.st_mtim.tv_nsec == after.st_mtim.tv_nsec;
}

/// `name`, with a number where k is not the first try, and shortened where it would be too long.
std::string Numbered(const std::string& name, int k) {
  const std::string end = k == 0 ? "" : fmt::format(".{}", k);
  return name.substr(0, kNameMax - end.size()) + end;
}

}  // namespace

Result<GuardedFolder> GuardedFolder::Open(const std::string& path) {
  std::error_code failed;
  std::filesystem::create_directories(path, failed);
  Descriptor fd(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd.get() < 0) return FailErrno(path, "no folder to work in", errno);
  const std::size_t end = path.find_last_not_of('/');  // "camera/" is shown as "camera"
  return GuardedFolder(path.substr(0, end == std::string::npos ? 0 : end + 1), std::move(fd));
}

Result<GuardedFolder> GuardedFolder::Subfolder(const std::string& name) const {
  if (mkdirat(fd_.get(), name.c_str(), 0777) != 0 && errno != EEXIST)
    return FailErrno(Shown(name), "cannot be made", errno);
  Descriptor fd(OpenAt(fd_.get(), name, O_RDONLY | O_DIRECTORY | O_NONBLOCK));
  if (fd.get() >= 0) return GuardedFolder(path_ + "/" + name, std::move(fd));
  const int error = errno;
  struct stat status {};
  if (fstatat(fd_.get(), name.c_str(), &status, AT_SYMLINK_NOFOLLOW) == 0 &&
      !S_ISDIR(status.st_mode)) {
    const char* kind = OtherKind(status.st_mode);
    return Fail(ErrorCode::kUnavailable, fmt::format("{}: {}, where a folder is to be", Shown(name),
                                                     kind == nullptr ? "a file" : kind));
  }
  return FailErrno(Shown(name), "cannot be opened", error);
}

Result<std::vector<std::string>> GuardedFolder::Names(std::size_t count_max) const {
  // The folder is opened again, since fdopendir keeps the descriptor and the position belongs to
  // the stream.
  const int fd = openat(fd_.get(), ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return FailErrno(path_, "cannot be read", errno);
  const std::unique_ptr<DIR, int (*)(DIR*)> stream(fdopendir(fd), &closedir);
  if (stream == nullptr) {
    const int error = errno;
    close(fd);
    return FailErrno(path_, "cannot be read", error);
  }
  std::vector<std::string> names;
  for (errno = 0; const dirent* entry = readdir(stream.get()); errno = 0) {
    const std::string name = entry->d_name;
    if (name == "." || name == "..") continue;
    if (names.size() == count_max)
      return Fail(ErrorCode::kFull,
                  fmt::format("{}: more than {} files: clear it up", path_, count_max));
    names.push_back(name);
  }
  if (errno != 0) return FailErrno(path_, "cannot be read", errno);
  std::sort(names.begin(), names.end());
  return names;
}

std::optional<FileIdentity> GuardedFolder::IdentityOf(const std::string& name) const {
  struct stat status {};
  if (fstatat(fd_.get(), name.c_str(), &status, AT_SYMLINK_NOFOLLOW) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino, status.st_size,
                      std::int64_t{status.st_mtim.tv_sec} * 1'000'000'000 + status.st_mtim.tv_nsec};
}

Result<std::string> GuardedFolder::Read(const std::string& name, std::size_t bytes_max) const {
  const auto refused = [&](const std::string& why) {
    return Fail(ErrorCode::kInvalid, Shown(name) + ": " + why);
  };
  // The kind is checked twice. Opening a device may have an effect, so the name is checked first.
  // The name may point elsewhere by the time it is opened, so the opened file is checked too.
  struct stat before {};
  if (fstatat(fd_.get(), name.c_str(), &before, AT_SYMLINK_NOFOLLOW) != 0)
    return FailErrno(Shown(name), "cannot be read", errno);
  if (const char* kind = OtherKind(before.st_mode)) return refused(std::string(kind) + ", no file");
  const Descriptor file(OpenAt(fd_.get(), name, O_RDONLY | O_NONBLOCK | O_NOCTTY));
  if (file.get() < 0 || fstat(file.get(), &before) != 0)
    return FailErrno(Shown(name), "cannot be read", errno);
  if (const char* kind = OtherKind(before.st_mode)) return refused(std::string(kind) + ", no file");
  const auto too_large = [&] {
    return refused(fmt::format("larger than {} MiB", bytes_max >> 20));
  };
  if (static_cast<std::uint64_t>(before.st_size) > bytes_max) return too_large();
  auto bytes = ReadAll(file.get(), bytes_max);
  if (!bytes && bytes.error() == EFBIG) return too_large();
  if (!bytes) return FailErrno(Shown(name), "cannot be read", bytes.error());
  struct stat after {};
  if (fstat(file.get(), &after) != 0 || !IsUnchanged(before, after) ||
      bytes->size() != static_cast<std::uint64_t>(after.st_size))
    return refused("changed while it was read: write it under another ending, then rename it");
  return std::move(*bytes);
}

Status GuardedFolder::Write(const std::string& name, const std::string& text) const {
  std::string beside;
  Descriptor file;
  for (int k = 0; k < kNamesTried && file.get() < 0; ++k) {
    beside = fmt::format(".focalfleet.{}.{}.tmp", getpid(), k);
    unlinkat(fd_.get(), beside.c_str(), 0);  // left by a killed process with the same number
    file = Descriptor(OpenAt(fd_.get(), beside, O_WRONLY | O_CREAT | O_EXCL, 0666));
    if (file.get() < 0 && errno != EEXIST) break;
  }
  if (file.get() < 0) return FailErrno(Shown(name), "cannot be written", errno);
  int error = WriteAll(file.get(), text);
  // A link or pipe of this name is replaced, not followed; a folder is not replaced.
  if (error == 0 &&
      (!IsOneName(name) || renameat(fd_.get(), beside.c_str(), fd_.get(), name.c_str()) != 0))
    error = IsOneName(name) ? errno : EINVAL;
  if (error == 0) return {};
  unlinkat(fd_.get(), beside.c_str(), 0);
  return FailErrno(Shown(name), "cannot be written", error);
}

Status GuardedFolder::Move(const std::string& name, const GuardedFolder& to) const {
  for (int k = 0; k < kEqualNames; ++k) {
    const std::string free = Numbered(name, k);
    int moved = renameat2(fd_.get(), name.c_str(), to.fd_.get(), free.c_str(), RENAME_NOREPLACE);
    // Some file systems lack the flag (NFS): the name is looked up first there.
    if (moved != 0 && errno == EINVAL && !to.IdentityOf(free))
      moved = renameat(fd_.get(), name.c_str(), to.fd_.get(), free.c_str());
    if (moved == 0) return {};
    if (errno != EEXIST && errno != EINVAL) break;
  }
  return FailErrno(Shown(name), "cannot be moved", errno);
}

std::string GuardedFolder::Shown(const std::string& name) const {
  std::string shown = path_ + "/" + name;
  for (char& c : shown)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '?';
  return shown;
}

}  // namespace focalfleet
