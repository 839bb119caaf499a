// Odd places are in steps, or repeated, other than those of a camera with many digits.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>

#include "protocol/base/rng.h"
#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// Every place on the grid of a step.
inline Campaign InSteps(Campaign campaign, double step_mm) {
  for (std::vector<double>* place : {&campaign.x_mm, &campaign.y_mm})
    for (double& at_mm : *place) at_mm = std::round(at_mm / step_mm) * step_mm;
  return campaign;
}

/// A campaign in which a random share of the units is moved in each exposure. The others stay, and
/// their row repeats the place before where `carried_on`, else it is missing.
inline Campaign MovedInTurns(Campaign campaign, double share_moved, bool carried_on,
                             std::uint64_t seed = 1) {
  Rng rng = Rng::Stream(seed, "turns");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit] + 1; row < campaign.first_row[unit + 1];
         ++row) {
      const bool moved = rng.Uniform() < share_moved;
      for (const std::size_t axis : {kTheta, kPhi}) {
        campaign.from_deg[axis][row] = campaign.cmd_deg[axis][row - 1];
        if (!moved) campaign.cmd_deg[axis][row] = campaign.cmd_deg[axis][row - 1];
      }
      if (moved) continue;
      const double missing = std::numeric_limits<double>::quiet_NaN();
      campaign.x_mm[row] = carried_on ? campaign.x_mm[row - 1] : missing;
      campaign.y_mm[row] = carried_on ? campaign.y_mm[row - 1] : missing;
    }
  return campaign;
}

/// A campaign in which this share of the units has the places of the exposure before.
inline Campaign ReadTwice(Campaign campaign, std::size_t exposure, double share = 1,
                          std::uint64_t seed = 1) {
  Rng rng = Rng::Stream(seed, "stale");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    if (rng.Uniform() >= share) continue;
    const std::size_t row = campaign.first_row[unit] + exposure;
    campaign.x_mm[row] = campaign.x_mm[row - 1];
    campaign.y_mm[row] = campaign.y_mm[row - 1];
  }
  return campaign;
}

}  // namespace focalfleet::sim
