// Where the fitted static geometry differs from the table by more than chance: zero_offset,
// base_offset, arm_length, per axis. Parameters that a unit's moves hardly tell apart are not
// blamed one by one: a group joins only if what the groups before it leave unexplained needs it.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

std::vector<CauseFound> FindGeometryCauses(const Fit& fit, double family_wise);

}  // namespace focalfleet::sim
