// A clock answer is a reading of a unit's counter. It feeds the unit's clock map, raises an alarm
// where the clock runs outside of what plans allow for, and dates the start of the unit's motion.
#pragma once

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// `at` is when the frame had ended.
void OnClock(const Coordination& fleet, PositionerIndex i, const ClockReply& reply, HostInstant at);

}  // namespace focalfleet
