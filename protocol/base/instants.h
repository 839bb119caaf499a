// Time has types, never a bare number. HostInstant: nanoseconds of the coordinator's monotonic
// clock (virtual in tests; scaled where a simulated fleet runs faster than life). DeviceTicks: 100
// us counts of one unit's own clock. The wall clock lives in daemon/ only.
#pragma once

#include <compare>
#include <cstdint>

namespace focalfleet {

struct DurationNs {
  std::int64_t ns = 0;
  constexpr auto operator<=>(const DurationNs&) const = default;
  constexpr DurationNs operator+(DurationNs o) const { return {ns + o.ns}; }
  constexpr DurationNs operator-(DurationNs o) const { return {ns - o.ns}; }
  constexpr DurationNs operator*(std::int64_t k) const { return {ns * k}; }
  [[nodiscard]] constexpr double seconds() const { return static_cast<double>(ns) * 1e-9; }
};

constexpr DurationNs Milliseconds(std::int64_t ms) { return {ms * 1'000'000}; }
constexpr DurationNs Microseconds(std::int64_t us) { return {us * 1'000}; }
constexpr DurationNs Seconds(double s) { return {static_cast<std::int64_t>(s * 1e9)}; }

struct HostInstant {
  std::int64_t ns = 0;
  constexpr auto operator<=>(const HostInstant&) const = default;
  constexpr HostInstant operator+(DurationNs d) const { return {ns + d.ns}; }
  constexpr HostInstant operator-(DurationNs d) const { return {ns - d.ns}; }
  constexpr DurationNs operator-(HostInstant o) const { return {ns - o.ns}; }
};
inline constexpr HostInstant kNever{INT64_MAX};

/// One unit's own counter, one tick is 100 us by that unit's clock.
struct DeviceTicks {
  std::uint64_t count = 0;
  constexpr auto operator<=>(const DeviceTicks&) const = default;
};
inline constexpr DurationNs kTick = Microseconds(100);

}  // namespace focalfleet
