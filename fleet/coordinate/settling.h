// Settling units carry out moves of an earlier run of the daemon. The plan is gone with that run,
// and its units are clear of each other as long as each keeps its time. Where one has ended early,
// or is not heard, the units near it that still move are stopped. They have then ended early
// themselves, so the stops spread as far as motion is near motion.
#pragma once

#include <string>

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// The unit's open move is one of an earlier run.
[[nodiscard]] bool IsOfEarlierRun(const Coordination& fleet, PositionerIndex i);
/// The unit may stand on its way: stops the settling units near it. `what` it does, for people.
void StopSettlingNear(const Coordination& fleet, PositionerIndex i, const std::string& what);
/// The move of an earlier run ended before its end.
void EndedEarly(const Coordination& fleet, PositionerIndex i);
/// The unit settles from here on, and is stopped where a unit near it ended early.
void BeginSettling(const Coordination& fleet, PositionerIndex i);

}  // namespace focalfleet
