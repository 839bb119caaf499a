// One unit's clock against the host's, from the answers to clock requests.
//
// An answer says what the unit's counter showed when the request had ended. When that was the host
// knows only within bounds: not before it let the request go, not after it heard the answer less
// the time that the answer took. On an idle bus that is some tenths of a millisecond, behind a full
// horizon some milliseconds. A handful of such readings gives
//
//   rate    of the unit's clock, by regression over their middles, and the bounds that all pairs of
//           readings leave: with two 10 s apart and 0.5 ms wide each, 50 ppm
//   time    of any reading of the counter, by the same regression, and the bounds that all readings
//           leave with all rates that are possible
//
// The bounds hold whatever the delays were; the regression is only the likeliest value within them.
// Readings that contradict each other mean another clock than before (the unit restarted): then
// only the newest counts.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "protocol/base/instants.h"

namespace focalfleet {

class ClockMap {
 public:
  /// A reading and when it was taken, both ends included.
  struct Reading {
    std::uint32_t ticks = 0;
    HostInstant earliest;
    HostInstant latest;
  };
  /// Pre: earliest <= latest, and neither is before the last one's. Takes the place of the oldest
  /// one where there are kReadings already.
  void Observe(const Reading& reading);
  void Forget() { count_ = 0; }

  [[nodiscard]] std::size_t readings() const { return count_; }

  struct Rate {
    double error = 0;  // unit's seconds a host's second, less 1
    double bound = 0;  // the true one is within error +- bound
  };
  /// Without readings and with one only: 0, with the widest bound.
  [[nodiscard]] Rate rate() const;

  struct Instant {
    HostInstant at;
    DurationNs bound;  // the true one is within at +- bound
    [[nodiscard]] HostInstant earliest() const { return at - bound; }
    [[nodiscard]] HostInstant latest() const { return at + bound; }
  };
  /// When the counter showed `ticks`: the time nearest to the newest reading. Pre: a reading.
  [[nodiscard]] Instant TimeOf(std::uint32_t ticks) const;

  static constexpr std::size_t kReadings = 8;
  /// No clock is off by more. Wider than what units may have, so that one beyond it is seen.
  static constexpr double kRateErrorMax = 0.02;
  /// By how much a rate may change while kReadings are taken (temperature).
  static constexpr double kWander = 20e-6;

 private:
  struct Kept {
    std::int64_t ticks = 0;  // unwrapped
    HostInstant earliest;
    HostInstant latest;
    [[nodiscard]] HostInstant middle() const {
      return {earliest.ns + (latest.ns - earliest.ns) / 2};
    }
  };
  struct Line {  // middle of the readings, and host ns a tick
    double ticks = 0;
    double host_ns = 0;  // since the newest reading's middle
    double ns_per_tick = 0;
  };
  struct Rates {
    double low = 1 - kRateErrorMax;
    double high = 1 + kRateErrorMax;
  };

  [[nodiscard]] const Kept& newest() const { return kept_[count_ - 1]; }
  [[nodiscard]] std::int64_t Unwrap(std::uint32_t ticks, HostInstant at) const;
  [[nodiscard]] Rates PossibleRates() const;
  [[nodiscard]] Line Fit(const Rates& rates) const;
  /// From one reading: when the counter showed `ticks`.
  static void Narrow(const Kept& reading, std::int64_t ticks, const Rates& rates,
                     HostInstant* earliest, HostInstant* latest);

  std::array<Kept, kReadings> kept_{};  // the oldest first
  std::size_t count_ = 0;
};

}  // namespace focalfleet
