// The clocks of a plane's hosts are compared by the messages that pass anyway. An order leaves the
// plane at `sent` by the plane's clock, reaches the sector at `received` by the sector's; a report
// leaves the sector at `returned` and reaches the plane at `now`. The time by which the sector's
// clock is ahead lies between
//
//   returned - now   and   received - sent
//
// because no message arrives before it was sent. The middle is the estimate, half the width its
// bound: half the time under way, both ways. Delays that differ by direction are within it. The
// clocks are monotonic, so a step of the time of day does no harm, and PTP or chrony are not
// needed. An old sample's bound grows by the most that two clocks drift apart.
#pragma once

#include <array>
#include <cstddef>
#include <optional>

#include "protocol/base/instants.h"

namespace focalfleet {

struct ClockOffset {
  DurationNs ahead;  // the sector's clock less the plane's
  DurationNs bound;  // the true one is within ahead +- bound
};

class SectorClock {
 public:
  struct Sample {
    HostInstant sent;      // the plane's clock
    HostInstant received;  // the sector's
    HostInstant returned;  // the sector's
    HostInstant now;       // the plane's
  };
  /// A sample that contradicts itself is passed over.
  void Add(const Sample& sample);
  /// The sector's host is another one now.
  void Forget() { count_ = 0; }
  /// The best of the last samples; none: there is none.
  [[nodiscard]] std::optional<ClockOffset> At(HostInstant now) const;

 private:
  struct Kept {
    ClockOffset offset;
    HostInstant at;
  };
  static constexpr std::size_t kKept = 32;
  std::array<Kept, kKept> kept_{};
  std::size_t count_ = 0;  // ever
};

}  // namespace focalfleet
