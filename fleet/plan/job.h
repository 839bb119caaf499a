// The work of the planner's thread for the coordinator: one job in, one answer out, no state
// between.
#pragma once

#include <span>

#include "fleet/coordinator.h"

namespace focalfleet {

/// Plans one job, which is one of three kinds.
/// - A configuration.
/// - The next wave of homing. As many units of `job.to_home` home together as can do so with no
/// unit moved aside, no two of them neighbours. Else one of them homes, with the moves that make
/// way for it.
/// - A late move in a configuration that is under way. Its predicted makespan is its end, counted
/// from the configuration's start signal.
/// An abandoned job ends soon, with kUnavailable where there is no plan yet.
PlanDone RunPlanJob(const PlanJob& job, const Layout& layout, std::span<const UnitDrive> drives,
                    const Abandoned& abandoned = {});

/// The answer to a job that was not done, and why.
PlanDone PlanFailed(const PlanJob& job, Error why);

}  // namespace focalfleet
