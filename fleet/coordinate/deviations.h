// A deviation is a unit that is elsewhere than the plan of the round has it: it stands, or it has a
// late move. Late moves are planned with the deviations of the moment.
#pragma once

#include <optional>
#include <vector>

#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"
#include "fleet/plan/replan.h"

namespace focalfleet {

// Pre, of all below: the round has a running plan.

/// None: the unit is where the plan of this round has it.
[[nodiscard]] std::optional<Deviation> DeviationOf(const Coordination& fleet, const Round& round,
                                                   PositionerIndex i);
/// Those of all units, ascending.
[[nodiscard]] std::vector<Deviation> Deviations(const Coordination& fleet, const Round& round);
/// Those of the neighbours of `i`, ascending.
[[nodiscard]] std::vector<Deviation> DeviationsNear(const Coordination& fleet, const Round& round,
                                                    PositionerIndex i);

}  // namespace focalfleet
