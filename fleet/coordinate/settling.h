// Units may still carry out moves of an earlier run of the daemon when the next one begins: they
// are kSettling. The plan is gone with that run, and its units are clear of each other as long as
// each keeps its time. Where one has ended early, or is not heard, the units near it that may still
// move are stopped. They have then ended early themselves, so the stops spread as far as motion is
// near motion. In a plane they do not cross the border of a sector.
#pragma once

#include <string>

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// The unit has an open move of an earlier run. A unit that has not answered has that of the serial
/// number that belongs here.
[[nodiscard]] bool HasEarlierMove(const Coordination& fleet, PositionerIndex i);
/// The unit may stand on its way: stops those near it that carry out earlier moves. `what` it does,
/// for people.
void StopSettlingNear(const Coordination& fleet, PositionerIndex i, const std::string& what);
/// The unit's move of an earlier run ended before its end.
void EndedEarly(const Coordination& fleet, PositionerIndex i);
/// The unit is not heard any more, or has not answered at all. Nothing where it has no earlier
/// move.
void LostOnItsWay(const Coordination& fleet, PositionerIndex i);
/// The unit settles from here on, and is stopped where a unit near it ended early or was lost.
void BeginSettling(const Coordination& fleet, PositionerIndex i);

}  // namespace focalfleet
