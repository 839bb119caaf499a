#include "daemon/systemd/journal_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

void Append(const JournalField& field, std::string* event) {
  const std::string_view value = field.value.substr(0, JournalSocket::kValueBytesMax);
  *event += field.name;
  if (value.find('\n') == std::string_view::npos) {
    *event += '=';
  } else {  // a value of several lines stands behind its length, in 8 bytes, least first
    *event += '\n';
    for (int byte = 0; byte < 8; ++byte)
      *event += static_cast<char>(value.size() >> (8 * byte) & 0xff);
  }
  *event += value;
  *event += '\n';
}

}  // namespace

bool StandardErrorIsJournal(const Environment& environment) {
  const char* const stream = environment("JOURNAL_STREAM");
  struct stat status {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &status) != 0) return false;
  return stream == std::to_string(status.st_dev) + ":" + std::to_string(status.st_ino);
}

JournalSocket::JournalSocket(std::string path)
    : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)), path_(std::move(path)) {}
JournalSocket::~JournalSocket() {
  if (fd_ >= 0) ::close(fd_);
}

bool JournalSocket::Send(std::span<const JournalField> fields) const {
  sockaddr_un to{};
  if (fd_ < 0 || path_.size() >= sizeof to.sun_path) return false;
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, path_.data(), path_.size());
  std::string event;
  for (const JournalField& field : fields) Append(field, &event);
  const ssize_t sent = ::sendto(fd_, event.data(), event.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                static_cast<const sockaddr*>(static_cast<void*>(&to)), sizeof to);
  return sent == static_cast<ssize_t>(event.size());
}

}  // namespace focalfleet
