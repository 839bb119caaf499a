// The timers hold for each unit when the next thing is due for it. A step touches only the units
// whose timers have run out.
#pragma once

#include <functional>
#include <optional>
#include <queue>
#include <vector>

#include "protocol/base/ids.h"
#include "protocol/base/instants.h"

namespace focalfleet {

class UnitTimers {
 public:
  explicit UnitTimers(std::size_t units) : due_(units, kNever) {}

  /// Replaces the timer of `i`; kNever: none. Cost: O(log units).
  void Set(PositionerIndex i, HostInstant at) {
    due_[i.value] = at;
    if (at != kNever) timers_.push({at, i});
  }

  /// The unit whose timer ran out first, by the time and then by the index; none: no timer has run
  /// out at `now`. Its timer is taken.
  [[nodiscard]] std::optional<PositionerIndex> TakeDue(HostInstant now) {
    while (!timers_.empty() && timers_.top().at <= now) {
      const Timer timer = timers_.top();
      timers_.pop();
      if (due_[timer.unit.value] != timer.at) continue;  // replaced since
      due_[timer.unit.value] = kNever;
      return timer.unit;
    }
    return std::nullopt;
  }

  /// No timer runs out before; it may be that of a timer replaced since.
  [[nodiscard]] HostInstant earliest() const { return timers_.empty() ? kNever : timers_.top().at; }

 private:
  struct Timer {
    HostInstant at;
    PositionerIndex unit;
    bool operator>(const Timer& o) const { return at != o.at ? at > o.at : unit > o.unit; }
  };

  std::vector<HostInstant> due_;  // by unit
  std::priority_queue<Timer, std::vector<Timer>, std::greater<>> timers_;
};

}  // namespace focalfleet
