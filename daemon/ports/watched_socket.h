// A socket that comes and goes behind one descriptor that stays: the socket sits alone in an epoll
// of its own, and the event loop watches that epoll.
#pragma once

#include "protocol/base/result.h"

namespace focalfleet {

class WatchedSocket {
 public:
  /// Errors: kUnavailable: no descriptors left.
  static Result<WatchedSocket> Create();
  WatchedSocket(WatchedSocket&& other) noexcept;
  WatchedSocket& operator=(WatchedSocket&& other) noexcept;
  WatchedSocket(const WatchedSocket&) = delete;
  WatchedSocket& operator=(const WatchedSocket&) = delete;
  ~WatchedSocket();

  /// Takes `socket` over, closes the one before.
  void Open(int socket);
  void Close();
  /// Whether room to send also counts as something to do.
  void WatchSending(bool watch);

  [[nodiscard]] int fd() const { return epoll_; }
  [[nodiscard]] int socket() const { return socket_; }
  [[nodiscard]] bool open() const { return socket_ >= 0; }

 private:
  explicit WatchedSocket(int epoll) : epoll_(epoll) {}

  int epoll_ = -1;
  int socket_ = -1;
  bool sending_ = false;
};

}  // namespace focalfleet
