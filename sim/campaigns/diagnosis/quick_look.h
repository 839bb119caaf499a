// Shapes too many to be scored one by one, as every step that commands may be rounded to: a glance
// along the axis' angle alone, without geometry, neighbours or the noise's memory, finds those that
// are worth a score.
#pragma once

#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// The few templates of the library's effects' `glance` that stand out in some unit, or in the sum
/// over the fleet, with the number of those looked at as their `choices`.
Templates WorthAScore(const Fit& fit, const Templates& library);

}  // namespace focalfleet::sim
