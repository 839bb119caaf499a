// Feasibility of one unit as if all movable units were out of its way: whether it can come to its
// target at all, and what stands in its straight way.
#pragma once

#include <cstdint>
#include <optional>

#include "fleet/plan/sequential_planner.h"
#include "fleet/plan/service.h"

namespace focalfleet {

/// True: a way may lead from the start to the target. False: no search finds one; `proof`, where it
/// is possible, says that none exists. Pre: `surroundings` is of the same scene and starts.
bool CanEver(const Service& service, std::uint32_t unit, Surroundings* surroundings,
             std::optional<NoWay>* proof);

/// The unit that stands in the straight way of a stuck unit. kNoUnitIndex: not known, or an
/// obstacle.
std::uint32_t InTheWayOf(const Service& service, std::uint32_t unit);

}  // namespace focalfleet
