// The load of a supply rail's harness. Units hang on it one behind the other; each motor in motion
// draws its current through every segment between the supply and its unit, so that a unit sees the
// drop of the segments that it shares with each of them (Kirchhoff's laws), and that of the feed.
#pragma once

#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// Both in motors, an axis in motion each. Where the table counts more movers on the rail than the
/// campaign has rows of, the rest are taken to be spread like those.
struct HarnessLoads {
  std::vector<double> motors;  // Shape: (rows): in motion on the unit's rail
  // Shape: (rows): the same, each times the share of the harness that its unit has in common with
  // the row's unit. Empty where slots are not known.
  std::vector<double> shared_motors;
};

/// Pre: step_deg of both axes by row; `rail`, `slot` (may be empty) and `movers` by row.
HarnessLoads FindHarnessLoads(const Exposures& exposures, const std::vector<double> (&step_deg)[2],
                              const std::vector<double>& rail, const std::vector<double>& slot,
                              const std::vector<double>& movers);

}  // namespace focalfleet::sim
