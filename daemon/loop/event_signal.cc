#include "daemon/loop/event_signal.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

namespace focalfleet {

Result<EventSignal> EventSignal::Create() {
  const int fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (fd < 0)
    return Fail(ErrorCode::kUnavailable, std::string("no eventfd: ") + std::strerror(errno));
  return EventSignal(fd);
}

EventSignal::EventSignal(EventSignal&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
EventSignal& EventSignal::operator=(EventSignal&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}
EventSignal::~EventSignal() {
  if (fd_ >= 0) ::close(fd_);
}

void EventSignal::Raise() const {
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(fd_, &one, sizeof one);
}

void EventSignal::Clear() const {
  std::uint64_t count = 0;
  [[maybe_unused]] const ssize_t got = ::read(fd_, &count, sizeof count);
}

void EventSignal::Wait(std::optional<std::chrono::milliseconds> timeout) const {
  pollfd poller{fd_, POLLIN, 0};
  ::poll(&poller, 1, timeout ? static_cast<int>(timeout->count()) : -1);
  Clear();
}

}  // namespace focalfleet
