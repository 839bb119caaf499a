// Motion reports are what units say of their motion: their status when polled, and `done` when it
// ends. They close the intent, settle the place, and report to the executor what it must act on.
#pragma once

#include <cstdint>

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// Others pass where the moving or settling unit may stand: it is polled more often, and missed
/// sooner (stall_detection.h). Pre: its status has just been asked.
void PollSooner(const Coordination& fleet, PositionerIndex i);

void OnStatus(const Coordination& fleet, PositionerIndex i, const StatusReply& status);
/// `sequence` is that of the frame: 0 where the unit reports by itself.
void OnDone(const Coordination& fleet, PositionerIndex i, Done done, std::uint8_t sequence);

}  // namespace focalfleet
