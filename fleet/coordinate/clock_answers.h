// A clock answer is a reading of a unit's counter, and feeds the unit's clock map. The answer also
// dates the start of the unit's motion. An alarm is raised where the clock runs outside of what
// plans allow for.
#pragma once

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// `at` is when the frame had ended.
void OnClock(const Coordination& fleet, PositionerIndex i, const ClockReply& reply, HostInstant at);

}  // namespace focalfleet
