// One unit as if all that can move were out of its way: whether it can come to its target at all,
// and who stands in its straight way.
#pragma once

#include <cstdint>
#include <optional>

#include "fleet/plan/sequential_planner.h"
#include "fleet/plan/service.h"

namespace focalfleet {

/// Whether a way may lead from the start to the target. Pre: `surroundings` is of the same scene
/// and starts. False: there is none that a search finds; `proof` (where that is possible): there is
/// none at all.
bool CanEver(const Service& service, std::uint32_t unit, Surroundings* surroundings,
             std::optional<NoWay>* proof);

/// Who stands in the straight way of a stuck unit; kNoUnitIndex where that cannot be told or is an
/// obstacle.
std::uint32_t InTheWayOf(const Service& service, std::uint32_t unit);

}  // namespace focalfleet
