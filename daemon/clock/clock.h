// Host time of the daemon: the monotonic clock, times `speed` where a simulated fleet runs faster
// than real time. Daemon and focalfleet-sim agree on it without an exchange, because both scale the
// same clock of one machine.
#pragma once

#include <cmath>
#include <cstdint>
#include <ctime>

#include "daemon/clock/wall_time.h"
#include "protocol/base/instants.h"

namespace focalfleet {

inline std::int64_t ReadClockNs(clockid_t which) {
  timespec now{};
  ::clock_gettime(which, &now);
  return now.tv_sec * std::int64_t{1'000'000'000} + now.tv_nsec;
}
inline std::int64_t ReadMonotonicNs() { return ReadClockNs(CLOCK_MONOTONIC); }

class HostClock {
 public:
  /// `read` gives CLOCK_MONOTONIC in ns, and `wall` the time of day; tests and simulations pass
  /// clocks of their own.
  explicit HostClock(double speed = 1, std::int64_t (*read)() = ReadMonotonicNs,
                     WallTime (*wall)() = &WallTime::Now)
      : speed_(speed), read_(read), wall_(wall) {}

  [[nodiscard]] HostInstant Now() const { return FromMonotonic(read_()); }
  /// The reading of CLOCK_MONOTONIC, in ns, at which host time reaches `at`, rounded up.
  [[nodiscard]] std::int64_t ToMonotonic(HostInstant at) const {
    if (at == kNever) return at.ns;
    return static_cast<std::int64_t>(std::ceil(static_cast<double>(at.ns) / speed_));
  }
  [[nodiscard]] HostInstant FromMonotonic(std::int64_t ns) const {
    if (speed_ == 1) return {ns};
    return {static_cast<std::int64_t>(static_cast<double>(ns) * speed_)};
  }
  /// The host time that passes in this real time.
  [[nodiscard]] DurationNs Real(DurationNs duration) const {
    return {static_cast<std::int64_t>(static_cast<double>(duration.ns) * speed_)};
  }
  [[nodiscard]] double speed() const { return speed_; }
  [[nodiscard]] WallTime Wall() const { return wall_(); }

 private:
  double speed_;
  std::int64_t (*read_)();
  WallTime (*wall_)();
};

}  // namespace focalfleet
