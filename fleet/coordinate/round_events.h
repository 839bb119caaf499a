// A unit event changes the part of a unit in the round. A motion that ended settles it; a unit that
// is lost or fails leaves the round, and its followers are stopped.
#pragma once

#include <string>

#include "fleet/coordinate/executor_rooms.h"
#include "fleet/coordinate/unit_event.h"

namespace focalfleet {

/// Takes an event of any kind but kForeignStop, which ends the whole configuration.
void TakeEvent(const UnitEvent& event, ExecutorRooms* rooms);

/// The unit does not take its move: it leaves the round with a strike, and is read anew.
void FailBeforeStart(PositionerIndex i, const std::string& reason, ExecutorRooms* rooms);

}  // namespace focalfleet
