// WatchedSocket is a socket that can be replaced behind one fixed descriptor. The socket sits alone
// in an epoll of its own, and the event loop watches that epoll.
#pragma once

#include "protocol/base/result.h"

namespace focalfleet {

class WatchedSocket {
 public:
  /// A watched socket without a socket yet.
  /// Errors: kUnavailable: no descriptors left.
  static Result<WatchedSocket> Create();
  WatchedSocket(WatchedSocket&& other) noexcept;
  WatchedSocket& operator=(WatchedSocket&& other) noexcept;
  WatchedSocket(const WatchedSocket&) = delete;
  WatchedSocket& operator=(const WatchedSocket&) = delete;
  ~WatchedSocket();

  /// Takes ownership of `socket`, and closes the one before.
  void Open(int socket);
  void Close();
  /// Sets whether room to send also makes the descriptor readable.
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
