// The start skew is how far apart the units of a round began, from the reports of their own clocks.
//
// A start is known within bounds (clock_map.h), so the skew is, too. The last may have begun at
// most max(latest) - min(earliest) after the first, and at least max(earliest) - min(latest). Plans
// allow for a start `start_skew_s` before or after a common instant: for 2 start_skew_s in all.
// Only the least that the skew can have been proves that this was not enough, and the next plans
// allow for so much. A host that was busy knows less, and never something that is not so.
#pragma once

#include <algorithm>
#include <cstdint>

#include "fleet/coordinate/clock_map.h"
#include "fleet/layout.h"

namespace focalfleet {

class StartSkew {
 public:
  /// A start within less than this is well known: a tenth of what plans allow for. With half of it,
  /// units behind a full horizon of their bus would never be. With double, the uncertainty of a
  /// start would pass for skew of that size.
  static constexpr DurationNs kWellKnown = Milliseconds(4);

  void Clear() { *this = {}; }
  void Add(PositionerIndex unit, const ClockMap::Instant& began) {
    if (reported_ == 0 || began.latest < surely_first_.began.latest) surely_first_ = {unit, began};
    if (reported_ == 0 || began.earliest > surely_last_.began.earliest)
      surely_last_ = {unit, began};
    earliest_ = std::min(earliest_, began.earliest);
    latest_ = std::max(latest_, began.latest);
    ++reported_;
    if (began.latest - began.earliest > kWellKnown) return;
    if (well_known_ == 0 || began.at < first_.began.at) first_ = {unit, began};
    if (well_known_ == 0 || began.at > last_.began.at) last_ = {unit, began};
    ++well_known_;
  }

  [[nodiscard]] std::uint32_t reported() const { return reported_; }
  // Pre, of all below: reported() > 0.
  struct Start {
    PositionerIndex unit;
    ClockMap::Instant began;
  };
  [[nodiscard]] DurationNs least() const {
    return std::max(DurationNs{0}, surely_last_.began.earliest - surely_first_.began.latest);
  }
  [[nodiscard]] DurationNs most() const { return latest_ - earliest_; }
  /// The two units by which the skew is known to be at least least().
  [[nodiscard]] const Start& surely_first() const { return surely_first_; }
  [[nodiscard]] const Start& surely_last() const { return surely_last_; }
  /// The likeliest skew: that of the starts that are well known, and what the others prove. All
  /// units were given one instant; a start is no later for being badly known.
  [[nodiscard]] DurationNs likely() const { return std::max(least(), ThatIsWellKnown()); }
  [[nodiscard]] PositionerIndex first() const { return (Proves() ? surely_first_ : first_).unit; }
  [[nodiscard]] PositionerIndex last() const { return (Proves() ? surely_last_ : last_).unit; }

 private:
  [[nodiscard]] DurationNs ThatIsWellKnown() const { return last_.began.at - first_.began.at; }
  [[nodiscard]] bool Proves() const { return well_known_ == 0 || least() > ThatIsWellKnown(); }

  std::uint32_t reported_ = 0;
  std::uint32_t well_known_ = 0;
  // Among these:
  Start first_;
  Start last_;
  // Among all:
  Start surely_first_;
  Start surely_last_;
  HostInstant earliest_{INT64_MAX};
  HostInstant latest_{INT64_MIN};
};

}  // namespace focalfleet
