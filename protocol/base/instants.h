// Time has types and is never a bare number. HostInstant counts nanoseconds of the coordinator's
// monotonic clock; it is virtual in tests, and scaled where a simulated fleet runs faster than real
// time. DeviceTicks counts 100 us by one unit's own clock. The wall clock exists in daemon/ only.
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

/// A count of one unit's own clock. Units: 100 us by that clock.
struct DeviceTicks {
  std::uint64_t count = 0;
  constexpr auto operator<=>(const DeviceTicks&) const = default;
};
inline constexpr DurationNs kTick = Microseconds(100);
inline constexpr double kTickS = 1e-4;  // the same in seconds

}  // namespace focalfleet
