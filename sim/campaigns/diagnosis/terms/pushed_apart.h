// Arms that touch push each other apart: two neighbours are far from every prediction in the same
// exposure, each away from the other, and they are near. Rows that are far for reasons of their own
// point anywhere, and their neighbours stand anywhere. No law of the contact is needed.
#pragma once

#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

struct PushedApart {
  std::vector<std::size_t> rows;  // of both units, in ascending order
  double log_p = 0;               // of such directions and distances by chance
  double size_um = 0;             // rms of these rows
};

/// Far rows of neighbours that were pushed apart; nullopt where chance explains them at this
/// family-wise rate. The directions are those between the fibres, or between the nearest points of
/// the arms. Rows of the same two units count once. `far`: rows. Cost: O(rows) where there are such
/// neighbours.
std::optional<PushedApart> FindPushedApart(const Fit& fit, const std::vector<std::size_t>& far,
                                           double family_wise);

}  // namespace focalfleet::sim
