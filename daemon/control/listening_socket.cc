#include "daemon/control/listening_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

std::string Reason() { return std::strerror(errno); }

/// Whether a process accepts connections at this address.
bool Answers(const UnixAddress& address) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return true;  // unknown: the path is not taken away from another server
  const int status = ::connect(fd, address.get(), address.length());
  // EAGAIN: the server lives, only its backlog is full.
  const bool answers = status == 0 || (errno != ECONNREFUSED && errno != ENOENT);
  ::close(fd);
  return answers;
}

Status CheckFree(const std::string& path, const UnixAddress& address) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) {
    if (errno == ENOENT) return {};
    return Fail(ErrorCode::kUnavailable, path + ": " + Reason());
  }
  if (!S_ISSOCK(info.st_mode))
    return Fail(ErrorCode::kUnavailable, path + " exists and is not a socket");
  if (Answers(address))
    return Fail(ErrorCode::kRefused, path + " is in use: another process answers there");
  return {};
}

}  // namespace

Result<ListeningSocket> ListeningSocket::Create(const std::string& path, std::uint32_t mode) {
  FOCALFLEET_TRY_ASSIGN(const UnixAddress address, UnixAddress::Of(path));
  const std::string temporary_path = path + ".new";
  FOCALFLEET_TRY_ASSIGN(const UnixAddress temporary, UnixAddress::Of(temporary_path));
  FOCALFLEET_TRY(CheckFree(path, address));
  ListeningSocket listener(path);
  FOCALFLEET_TRY(listener.Listen(temporary, temporary_path, mode));
  return listener;
}

ListeningSocket::ListeningSocket(ListeningSocket&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      device_(other.device_),
      inode_(std::exchange(other.inode_, 0)) {}

ListeningSocket& ListeningSocket::operator=(ListeningSocket&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  std::swap(device_, other.device_);
  std::swap(inode_, other.inode_);
  return *this;
}

ListeningSocket::~ListeningSocket() {
  if (fd_ >= 0) ::close(fd_);
  struct stat info {};
  if (inode_ != 0 && ::lstat(path_.c_str(), &info) == 0 && info.st_ino == inode_ &&
      info.st_dev == device_)
    ::unlink(path_.c_str());
}

int ListeningSocket::Accept() const {
  return ::accept4(fd_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
}

Status ListeningSocket::Listen(const UnixAddress& temporary, const std::string& temporary_path,
                               std::uint32_t mode) {
  const auto failed = [&] {
    return Fail(ErrorCode::kUnavailable, "cannot listen at " + path_ + ": " + Reason());
  };
  fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd_ < 0) return failed();
  ::unlink(temporary_path.c_str());
  if (::bind(fd_, temporary.get(), temporary.length()) != 0) return failed();
  struct stat info {};
  if (::chmod(temporary_path.c_str(), mode) != 0 || ::listen(fd_, SOMAXCONN) != 0 ||
      ::stat(temporary_path.c_str(), &info) != 0 ||
      ::rename(temporary_path.c_str(), path_.c_str()) != 0) {
    auto error = failed();
    ::unlink(temporary_path.c_str());
    return error;
  }
  device_ = info.st_dev;
  inode_ = info.st_ino;
  return {};
}

}  // namespace focalfleet
