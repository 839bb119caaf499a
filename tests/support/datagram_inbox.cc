#include "tests/support/datagram_inbox.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstring>

#include "protocol/base/check.h"

namespace focalfleet::test {

DatagramInbox::DatagramInbox(const std::string& address)
    : fd_(socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_un at{};
  FOCALFLEET_CHECK(fd_ >= 0 && address.size() < sizeof at.sun_path);
  at.sun_family = AF_UNIX;
  std::memcpy(at.sun_path, address.data(), address.size());
  if (address[0] == '@') at.sun_path[0] = '\0';
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address.size());
  FOCALFLEET_CHECK(bind(fd_, static_cast<const sockaddr*>(static_cast<void*>(&at)), length) == 0);
}

DatagramInbox::~DatagramInbox() { close(fd_); }

std::optional<std::string> DatagramInbox::Next(int limit_ms) const {
  pollfd poller{fd_, POLLIN, 0};
  if (poll(&poller, 1, limit_ms) != 1) return std::nullopt;
  std::string text(std::size_t{1} << 17, '\0');
  const ssize_t got = recv(fd_, text.data(), text.size(), 0);
  FOCALFLEET_CHECK(got >= 0);
  text.resize(static_cast<std::size_t>(got));
  return text;
}

std::optional<std::string> DatagramInbox::NextWith(const std::string& text, int limit_ms) const {
  using std::chrono::duration_cast, std::chrono::milliseconds, std::chrono::steady_clock;
  const auto until = steady_clock::now() + milliseconds(limit_ms);
  int left_ms = limit_ms;
  for (auto next = Next(left_ms); next; next = Next(left_ms)) {
    if (next->find(text) != std::string::npos) return next;
    const auto left = duration_cast<milliseconds>(until - steady_clock::now());
    left_ms = std::max(0, static_cast<int>(left.count()));
  }
  return std::nullopt;
}

}  // namespace focalfleet::test
