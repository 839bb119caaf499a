#include "daemon/metrics/planned_power.h"

#include <algorithm>

#include "fleet/estimate.h"

namespace focalfleet {

PlannedPower PowerOf(const Plan& plan, const PlanJob& job, const Layout& layout,
                     std::span<const UnitDrive> drives) {
  const PlanEstimate estimate = Estimate(plan, layout, drives, MotorModel{});
  PlannedPower power{.peak_W = estimate.peak_power_W,
                     .rail_limit_W = job.options.power.rail_W,
                     .limit_W = job.options.power.total_W};
  for (const RailCurve& rail : estimate.rails)
    for (const PowerStep& step : rail.steps)
      power.rail_peak_W[rail.rail] = std::max(power.rail_peak_W[rail.rail], step.power_W);
  return power;
}

}  // namespace focalfleet
