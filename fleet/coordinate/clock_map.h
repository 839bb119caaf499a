// A clock map relates one unit's clock to the host's, from the answers to clock requests.
//
// An answer holds what the unit's counter showed when the request had ended. The host knows that
// instant only within bounds, and these hold wherever host, kernel and bus are held up:
//
//   earliest   the time of the step that let the request go, read before that step began. The
//              request is on the bus later, and the unit reads its counter later still. A request
//              that is repeated keeps its sequence number. `earliest` is of the first copy, and
//              copies that a fault of the bus makes come later, too. Answers to earlier requests
//              have other numbers, and those of a run that was killed young. These come round after
//              254 requests: an answer that old would have to be overtaken by all later ones. An
//              answer to a request that has not left answers none. Requests never travel in groups;
//              staging frames alone do.
//   latest     a time read after the answer had been, or the kernel's stamp where that is sound
//              (FrameStamps). The unit read its counter before it answered. Among several copies of
//              an answer the first counts.
//
// A pause anywhere between the two makes the reading wider and never wrong. A reading whose bounds
// contradict each other is none, and dropped. On an idle bus a reading is some tenths of a
// millisecond wide, behind a full horizon some milliseconds. A handful of them gives
//
//   rate    of the unit's clock, by regression over their middles, and the bounds that all pairs of
//           readings leave: with two 10 s apart and 0.5 ms wide each, 50 ppm
//   time    of any reading of the counter, by the same regression, and the bounds that all readings
//           leave with all rates that are possible
//
// The regression is only the likeliest value within the bounds. The bounds of the rate exclude the
// truth only where one of these is not so:
//
//   - the counter ran through from the first reading kept to the last. A restart lets it begin
//     anew, and a young counter that did looks like a slow one. A reading is therefore put beside
//     earlier ones only where it shows more than 1.02 times the time since. No clock that is off by
// less than 2 % shows so much after a restart from 0. A reading that shows less stands alone.
// Readings that contradict each other
//     are of another clock, too: then only the newest counts. Either way nothing is said of a rate
//     before the next reading.
//   - the rate changes by less than kWander while kReadings are taken.
//
// The limit kRateErrorMax of all clocks is used for times and for the likeliest rate. The limit
// never says that a clock is off: `least` and `most` come from the readings alone.
//
// Two readings that are w1 and w2 wide and d apart leave a width of (w1 + w2 + 0.2 ms) / d between
// `least` and `most`. A clock that is off by 1 % is distinguished from one that is off by 0.5 % as
// soon as that is below 0.5 %. Two readings are enough where both are narrower than a fifth of a
// percent of the time between them. This share is 2 ms of 1 s, or 20 ms of the 10 s at rest. Where
// other readings are wide, two narrow ones among the last eight are enough.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

#include "protocol/base/instants.h"

namespace focalfleet {

class ClockMap {
  struct Rates {
    double low;
    double high;
  };
  /// A counter outside of these is no clock.
  static constexpr Rates kAny{0.1, 10};

 public:
  /// A reading and when it was taken, both ends included.
  struct Reading {
    std::uint32_t ticks = 0;
    HostInstant earliest;
    HostInstant latest;
  };
  /// Pre: taken after the last one. Takes the place of the oldest one where there are kReadings
  /// already. False: it was dropped, because its bounds contradict each other.
  bool Observe(const Reading& reading);
  void Forget() { count_ = 0; }

  [[nodiscard]] std::size_t readings() const { return count_; }

  /// Unit's seconds a host's second, less 1.
  struct Rate {
    double error = 0;  // the likeliest
    double bound = 0;  // the true one is within error +- bound
    // The true one is within these, by the readings alone.
    double least = kAny.low - 1;
    double most = kAny.high - 1;
    /// For certain it is off by more than `error_max`, one way or the other.
    [[nodiscard]] bool IsBeyond(double error_max) const {
      return least > error_max || most < -error_max;
    }
  };
  /// Without readings and with one only: 0, with the widest bound.
  [[nodiscard]] Rate rate() const;

  struct Instant {
    HostInstant at;  // the likeliest
    // The true one is within these, both included.
    HostInstant earliest;
    HostInstant latest;
    /// The true one is within at +- bound.
    [[nodiscard]] DurationNs bound() const { return std::max(at - earliest, latest - at); }
  };
  /// When the counter showed `ticks`: the time nearest to the newest reading. Pre: a reading.
  [[nodiscard]] Instant TimeOf(std::uint32_t ticks) const;

  static constexpr std::size_t kReadings = 8;
  /// No clock is off by more. A controller with such a clock would not keep up with a CAN bus. The
  /// bit timing there allows for 1.58 % at most (ISO 11898-1). Wider than what units may have.
  static constexpr double kRateErrorMax = 0.02;
  /// The most that a rate may change while kReadings are taken (temperature).
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
  static constexpr Rates kUsual{1 - kRateErrorMax, 1 + kRateErrorMax};

  [[nodiscard]] const Kept& newest() const { return kept_[count_ - 1]; }
  [[nodiscard]] bool RanThrough(const Reading& reading) const;
  void Keep(std::int64_t ticks, const Reading& reading);
  [[nodiscard]] std::int64_t Unwrap(std::uint32_t ticks, HostInstant at) const;
  /// The rates that the readings leave; low > high: they contradict each other.
  [[nodiscard]] Rates RatesByReadings() const;
  /// The usual ones among these, where there are any.
  [[nodiscard]] Rates PossibleRates() const;
  [[nodiscard]] Line Fit(const Rates& rates) const;
  /// From one reading: when the counter showed `ticks`.
  static void Narrow(const Kept& reading, std::int64_t ticks, const Rates& rates,
                     HostInstant* earliest, HostInstant* latest);

  std::array<Kept, kReadings> kept_{};  // the oldest first
  std::size_t count_ = 0;
};

}  // namespace focalfleet
