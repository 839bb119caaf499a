// The gap between a unit's outer arm and the nearest neighbour's at the commanded poses, and the
// side to which phi would have to yield.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

struct ArmGaps {
  // Shape: (rows): between the arms' centre lines; the pitch if farther.
  std::vector<double> gap_mm;
  std::vector<double> side;  // Shape: (rows): +1: the gap grows with phi; -1: it shrinks
};

/// The gap of every row. `neighbours` lists for each unit those whose arms may come near. Outer
/// arms only, from elbow to fibre, by the geometry of units.csv.
/// Cost: some 100 ns a row and neighbour.
ArmGaps FindArmGaps(const Campaign& campaign, const Exposures& exposures,
                    const std::vector<std::vector<std::size_t>>& neighbours, double pitch_mm);

}  // namespace focalfleet::sim
