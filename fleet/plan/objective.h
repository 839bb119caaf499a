// What else a plan may be good for than ending soon: little energy, a low peak, even power. Most
// units have time to spare, so a plan that is there already is changed unit by unit: among its
// candidates (candidates.h) and its own way begun sooner or later, each takes the one that serves
// the objective best and is clear of all others as these go, with notice where there was notice,
// within the limits of power and the time. So every plan on the way is proven, none is worse than
// the one before, and there are no deadlocks: whoever finds nothing better stays as it is.
//
// Energy. A motor that turns in step draws power all the time, so a move costs the more the slower
// it is: n is never raised, and below the tuned n there is no margin. The wave mode is tuning's to
// choose. What is left to save is turning: the detours that folding made.
//
// Power is counted as in power_ledger.h: for all slots in which a motor may run for any skew and
// clock. Even power is the least sum of squares over rails and slots; the least peak is found by
// bisection: what exceeds a limit, squared, goes to zero or the limit is too low.
#pragma once

#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"

namespace focalfleet {

/// A plan's moves changed for `options.objective`, ending within `options.within_s` (0: when `plan`
/// ends). Units whose pairs only an order has proven stay as they are.
/// Pre: `plan` is one for `request` and `options`.
/// Errors: kRefused where `plan` ends later than `within_s`: names the time that it takes.
/// Cost: some passes over all units, each some 100 us a unit.
Result<Plan> ImprovePlan(const PlanRequest& request, const PlanOptions& options, Plan plan);

}  // namespace focalfleet
