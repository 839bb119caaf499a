#include "daemon/systemd/notify_socket.h"

#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <charconv>
#include <cstddef>
#include <cstring>
#include <utility>

namespace focalfleet {
namespace {

/// A whole number in decimal digits; none: the variable is not set, or is something else.
std::optional<std::int64_t> NumberIn(const Environment& environment, const char* name) {
  const char* const text = environment(name);
  if (text == nullptr) return std::nullopt;
  std::int64_t value = 0;
  const char* const last = text + std::strlen(text);
  const auto [end, error] = std::from_chars(text, last, value);
  if (error != std::errc() || end != last) return std::nullopt;
  return value;
}

}  // namespace

NotifySocket NotifySocket::FromEnvironment(const Environment& environment) {
  const char* const value = environment("NOTIFY_SOCKET");
  std::string address = value != nullptr ? value : "";
  const bool is_address = address.starts_with('/') || address.starts_with('@');
  if (!is_address || address.size() < 2 || address.size() >= sizeof(sockaddr_un::sun_path))
    return {};
  if (address[0] == '@') address[0] = '\0';
  const int fd = ::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return {};
  return {fd, std::move(address)};
}

NotifySocket::NotifySocket(NotifySocket&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), address_(std::move(other.address_)) {}
NotifySocket& NotifySocket::operator=(NotifySocket&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(address_, other.address_);
  return *this;
}
NotifySocket::~NotifySocket() {
  if (fd_ >= 0) ::close(fd_);
}

bool NotifySocket::Send(std::string_view lines) const {
  if (!present()) return false;
  sockaddr_un to{};
  to.sun_family = AF_UNIX;
  std::memcpy(to.sun_path, address_.data(), address_.size());
  // The length ends with the name: all bytes of an abstract address count.
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + address_.size());
  const ssize_t sent = ::sendto(fd_, lines.data(), lines.size(), MSG_DONTWAIT | MSG_NOSIGNAL,
                                static_cast<const sockaddr*>(static_cast<void*>(&to)), length);
  return sent == static_cast<ssize_t>(lines.size());
}

std::optional<DurationNs> WatchdogInterval(const Environment& environment) {
  // The largest interval keeps nanoseconds far from overflow: a century.
  constexpr std::int64_t kMicrosecondsMax = std::int64_t{3'155'760'000} * 1'000'000;
  const auto microseconds = NumberIn(environment, "WATCHDOG_USEC");
  if (!microseconds || *microseconds <= 0 || *microseconds > kMicrosecondsMax) return std::nullopt;
  if (environment("WATCHDOG_PID") != nullptr &&
      NumberIn(environment, "WATCHDOG_PID") != std::int64_t{::getpid()})
    return std::nullopt;
  return DurationNs{*microseconds * 1000};
}

}  // namespace focalfleet
