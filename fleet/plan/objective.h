// Other objectives of a plan than ending soon: little energy, a low peak, even power.
//
// Most units have time to spare, so an existing plan is changed unit by unit. A unit chooses among
// its candidates (candidates.h) and its own way begun sooner or later. The choice is the one that
// serves the objective best and is clear of all others as these move. Where a pair had notice it
// keeps notice, and the limits of power and the time hold. Every plan on the way is therefore
// proven, none is worse than the one before, and there are no deadlocks. A unit that finds nothing
// better stays as it is.
//
// Energy. A motor that turns in step draws power all the time, so a slower move costs more.
// Therefore n is never raised, and below the tuned n there is no margin. The wave mode is chosen by
// tuning. Turning remains to be saved: the detours that folding made.
//
// Power is counted as in power_ledger.h: for all slots in which a motor may run for any skew and
// clock. Even power is the least sum of squares over rails and slots. The least peak is found by
// bisection: either the sum of what exceeds a limit, squared, goes to zero, or the limit is too
// low.
#pragma once

#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"

namespace focalfleet {

/// The moves of a plan, changed for `options.objective`, end within `options.within_s` (0: when
/// `plan` ends). Units whose pairs only an order has proven stay as they are.
/// Pre: `plan` is one for `request` and `options`.
/// Errors: kRefused where `plan` ends later than `within_s`: names the time that it takes.
/// Cost: some passes over all units, each some 100 us a unit.
Result<Plan> ImprovePlan(const PlanRequest& request, const PlanOptions& options, Plan plan);

}  // namespace focalfleet
