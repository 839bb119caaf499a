// The job for the planner of one round: where every unit stands, which units can move, and where
// they are to go.
#pragma once

#include <optional>

#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/executor_rooms.h"

namespace focalfleet {

/// Makes the next round's job, and settles the outcome of units that cannot take part. `sets_out`:
/// the first round since the last exposure. None: no unit is to move.
[[nodiscard]] std::optional<PlanJob> JobOfRound(bool sets_out, ExecutorRooms* rooms);

}  // namespace focalfleet
