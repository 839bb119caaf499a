// Geometry causes are differences of the fitted static geometry from the table by more than chance:
// zero_offset, base_offset, arm_length, per axis. Parameters that a unit's moves hardly separate
// are not blamed one by one. A group joins only if what the groups before it leave unexplained
// needs it.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

std::vector<CauseFound> FindGeometryCauses(const Fit& fit, double family_wise);

}  // namespace focalfleet::sim
