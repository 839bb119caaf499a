// How far apart the units of a round began, from what their own clocks told.
//
// A start is known within bounds (clock_map.h), so the skew is, too: the last may have begun at
// most max(latest) - min(earliest) after the first, and at least max(earliest) - min(latest). Plans
// allow for a start `start_skew_s` before or after a common instant: for 2 start_skew_s in all.
#pragma once

#include <algorithm>
#include <cstdint>

#include "fleet/coordinate/clock_map.h"
#include "fleet/layout.h"

namespace focalfleet {

class StartSkew {
 public:
  void Clear() { *this = {}; }
  void Add(PositionerIndex unit, const ClockMap::Instant& began) {
    if (told_ == 0 || began.at < first_at_) first_ = unit, first_at_ = began.at;
    if (told_ == 0 || began.at > last_at_) last_ = unit, last_at_ = began.at;
    earliest_first_ = std::min(earliest_first_, began.earliest());
    latest_first_ = std::min(latest_first_, began.latest());
    earliest_last_ = std::max(earliest_last_, began.earliest());
    latest_last_ = std::max(latest_last_, began.latest());
    ++told_;
  }

  [[nodiscard]] std::uint32_t told() const { return told_; }
  // Pre, of all below: told() > 0.
  [[nodiscard]] PositionerIndex first() const { return first_; }
  [[nodiscard]] PositionerIndex last() const { return last_; }
  [[nodiscard]] DurationNs likely() const { return last_at_ - first_at_; }
  [[nodiscard]] DurationNs least() const {
    return std::max(DurationNs{0}, earliest_last_ - latest_first_);
  }
  [[nodiscard]] DurationNs most() const { return latest_last_ - earliest_first_; }

 private:
  std::uint32_t told_ = 0;
  PositionerIndex first_;
  PositionerIndex last_;
  HostInstant first_at_;
  HostInstant last_at_;
  HostInstant earliest_first_{INT64_MAX};
  HostInstant latest_first_{INT64_MAX};
  HostInstant earliest_last_{INT64_MIN};
  HostInstant latest_last_{INT64_MIN};
};

}  // namespace focalfleet
