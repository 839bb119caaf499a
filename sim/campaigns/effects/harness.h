// The load of a supply rail's harness. Units are connected to it one behind the other. Each motor
// in motion draws its current through every segment between the supply and its unit. A unit sees
// the drop of the segments that it shares with each of them, and that of the feed (Kirchhoff's
// laws).
#pragma once

#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// Loads of each row, in motors: an axis in motion counts as one. Where the table counts more
/// movers on the rail than the campaign has rows of, the rest are assumed to be distributed like
/// those.
struct HarnessLoads {
  std::vector<double> motors;  // Shape: (rows): in motion on the unit's rail
  // Shape: (rows): the same, each motor times the share of the harness that its unit has in common
  // with the row's unit. Empty where slots are not known.
  std::vector<double> shared_motors;
};

/// Pre: step_deg of both axes by row; `rail`, `slot` (may be empty) and `movers` by row.
HarnessLoads FindHarnessLoads(const Exposures& exposures, const std::vector<double> (&step_deg)[2],
                              const std::vector<double>& rail, const std::vector<double>& slot,
                              const std::vector<double>& movers);

}  // namespace focalfleet::sim
