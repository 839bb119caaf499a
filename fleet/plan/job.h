// What the planner's thread does for the coordinator: one job in, one answer out, no state between.
#pragma once

#include <span>

#include "fleet/coordinator.h"

namespace focalfleet {

/// Plans a configuration, or the next wave of homing: as many of `job.to_home` as can home at once
/// with nobody stepping aside (no two of them neighbours), else one of them with the moves that
/// make way for it. Or a late move in one that is under way; its predicted makespan is its end,
/// counted from the configuration's start signal.
/// Abandoned, it ends soon, with kUnavailable for a plan.
PlanDone RunPlanJob(const PlanJob& job, const Layout& layout, std::span<const UnitDrive> drives,
                    const Abandoned& abandoned = {});

}  // namespace focalfleet
