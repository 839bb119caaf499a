#include "daemon/ports/watched_socket.h"

#include <sys/epoll.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

namespace focalfleet {

Result<WatchedSocket> WatchedSocket::Create() {
  const int epoll = ::epoll_create1(EPOLL_CLOEXEC);
  if (epoll < 0)
    return Fail(ErrorCode::kUnavailable, std::string("no epoll: ") + std::strerror(errno));
  return WatchedSocket(epoll);
}

WatchedSocket::WatchedSocket(WatchedSocket&& other) noexcept
    : epoll_(std::exchange(other.epoll_, -1)),
      socket_(std::exchange(other.socket_, -1)),
      sending_(other.sending_) {}

WatchedSocket& WatchedSocket::operator=(WatchedSocket&& other) noexcept {
  std::swap(epoll_, other.epoll_);
  std::swap(socket_, other.socket_);
  std::swap(sending_, other.sending_);
  return *this;
}

WatchedSocket::~WatchedSocket() {
  Close();
  if (epoll_ >= 0) ::close(epoll_);
}

void WatchedSocket::Open(int socket) {
  Close();
  socket_ = socket;
  epoll_event event{EPOLLIN, {.fd = socket}};
  ::epoll_ctl(epoll_, EPOLL_CTL_ADD, socket, &event);
}

void WatchedSocket::Close() {
  if (socket_ >= 0) ::close(socket_);
  socket_ = -1;
  sending_ = false;
}

void WatchedSocket::WatchSending(bool watch) {
  if (watch == sending_ || socket_ < 0) return;
  sending_ = watch;
  epoll_event event{watch ? EPOLLIN | EPOLLOUT : EPOLLIN, {.fd = socket_}};
  ::epoll_ctl(epoll_, EPOLL_CTL_MOD, socket_, &event);
}

}  // namespace focalfleet
