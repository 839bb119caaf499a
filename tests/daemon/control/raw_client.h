// A client of a control socket that sends and reads bytes, and waits for nothing.
#pragma once

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <string>
#include <string_view>

#include "daemon/control/unix_address.h"

namespace focalfleet::test {

/// A client that sends exactly the bytes that a test gives.
class RawClient {
 public:
  explicit RawClient(const std::string& path) {
    const auto address = UnixAddress::Of(path).value();
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
    EXPECT_EQ(::connect(fd_, address.get(), address.length()), 0);
  }
  ~RawClient() { Close(); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  std::size_t Send(std::string_view bytes) const {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    return sent > 0 ? static_cast<std::size_t>(sent) : 0;
  }
  /// All bytes that have come; `ended` says whether the server closed.
  std::string Receive(bool* ended = nullptr) const {
    std::string all;
    std::array<char, 65536> chunk;
    for (;;) {
      const ssize_t got = ::recv(fd_, chunk.data(), chunk.size(), 0);
      if (ended != nullptr) *ended = got == 0;
      if (got < 0 && errno == ECONNRESET) continue;  // reported once, before earlier bytes
      if (got <= 0) return all;
      all.append(chunk.data(), static_cast<std::size_t>(got));
    }
  }
  void EndInput() const { ::shutdown(fd_, SHUT_WR); }
  void Close() {
    if (fd_ >= 0) ::close(fd_);
    fd_ = -1;
  }

 private:
  int fd_ = -1;
};

}  // namespace focalfleet::test
