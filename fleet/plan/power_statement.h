// The power that a plan draws, in a few figures: whether the supply is strong enough, how even the
// load is, and what the plan costs.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "fleet/layout.h"
#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"

namespace focalfleet {

struct RailStatement {
  RailId rail;
  double energy_J = 0;
  double peak_W = 0;       // by nominal clocks
  double peak_most_W = 0;  // for all skews and clocks
  double flatness = 0;     // mean squared over mean square until the plan's end: 1 is even
};
struct PowerStatement {
  double energy_J = 0;
  double peak_W = 0;
  double peak_most_W = 0;
  double flatness = 0;
  std::vector<RailStatement> rails;  // ascending by rail
  [[nodiscard]] double LargestRail_W() const {
    double most_W = 0;
    for (const RailStatement& rail : rails) most_W = std::max(most_W, rail.peak_most_W);
    return most_W;
  }
};
/// The statement is exact, from the segments. Cost: O(s log s) for s segments.
PowerStatement StatePower(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives,
                          const PlanOptions& options);

}  // namespace focalfleet
