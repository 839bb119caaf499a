// The power that the newest plan will draw, by its own prediction, and the limits it was made for.
#pragma once

#include <map>

#include "fleet/coordinator.h"

namespace focalfleet {

struct PlannedPower {
  std::map<RailId, double> rail_peak_W;  // of each rail that the plan draws from
  double peak_W = 0;                     // of all rails together
  double rail_limit_W = 0;               // of each rail; 0: none
  double limit_W = 0;                    // of all rails together; 0: none
};

/// The power of a plan that was made for `job`. Cost: as Estimate (fleet/estimate.h).
PlannedPower PowerOf(const Plan& plan, const PlanJob& job, const Layout& layout,
                     std::span<const UnitDrive> drives);

}  // namespace focalfleet
