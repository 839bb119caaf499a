// The signal by which one thread wakes another that sleeps in epoll or poll: an eventfd. A second
// Raise before the Clear changes nothing.
#pragma once

#include <chrono>
#include <optional>

#include "protocol/base/result.h"

namespace focalfleet {

class EventSignal {
 public:
  /// Errors: kUnavailable: no descriptors left.
  static Result<EventSignal> Create();
  EventSignal(EventSignal&& other) noexcept;
  EventSignal& operator=(EventSignal&& other) noexcept;
  EventSignal(const EventSignal&) = delete;
  EventSignal& operator=(const EventSignal&) = delete;
  ~EventSignal();

  void Raise() const;  // any thread
  void Clear() const;
  /// Returns when the signal is raised, or after `timeout`. The signal is clear then.
  void Wait(std::optional<std::chrono::milliseconds> timeout) const;

  [[nodiscard]] int fd() const { return fd_; }

 private:
  explicit EventSignal(int fd) : fd_(fd) {}
  int fd_ = -1;
};

}  // namespace focalfleet
