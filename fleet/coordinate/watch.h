// The watch protects units from one that has halted by itself. Every moving unit whose early end
// would endanger others, its followers, is polled at the pace of stall_detection.h. When it has
// halted, is not heard, or is stopped, its followers are stopped, and their followers in turn.
//
// A follower is stopped only where it comes to a place that the first unit may still occupy. A
// follower that passes only places which the first unit has left, or has not reached yet, goes on.
#pragma once

#include <string>

#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"
#include "fleet/coordinate/sector_round.h"

namespace focalfleet {

/// Sets when a unit that starts is polled first. Pre: it has a move in this round.
void WatchFromStart(const Coordination& fleet, const Round& round, PositionerIndex i);
/// A unit that moves already has one more follower, and is polled as soon as that matters.
void WatchSoon(const Coordination& fleet, const Round& round, PositionerIndex i);

/// The nominal end of the move may be over by the quickest clock.
[[nodiscard]] bool MayHaveArrived(const Coordination& fleet, const Round& round,
                                  const Round::Course& course);

/// When a unit may have ended, both included.
struct Ended {
  HostInstant from;
  HostInstant until;
};
/// From when the unit was last seen moving, until `until`.
[[nodiscard]] Ended SeenUntil(const Coordination& fleet, PositionerIndex i, HostInstant until);
/// `first` may have ended within `ended`: stops the units that come where it may stand.
void StopFollowers(const Coordination& fleet, const Round& round, PositionerIndex first,
                   const Ended& ended, const std::string& reason);
/// Units beyond the border may have ended: stops the units that come where they may stand.
void StopFollowersBeyond(const Coordination& fleet, const Round& round,
                         const BorderEndCommand& end);
/// Asks one unit to stop until it answers.
void StopOne(const Coordination& fleet, PositionerIndex i, const std::string& reason);

}  // namespace focalfleet
