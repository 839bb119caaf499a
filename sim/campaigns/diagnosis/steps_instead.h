// Steps may explain the same as a cause. The error of one unit from its first short move on is a
// mode_threshold, or a slip at that move, to the last row. Where few units have a cause, they are
// fitted once more without it and with the steps that then show. The reverse holds too: a small
// step that was taken while the causes were not yet known may belong to one of them.
#pragma once

#include "sim/campaigns/diagnosis/fit.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Adds step_loss or lost_command as rivals of terms in few units that steps explain as well,
/// though not for their price.
void CompareWithSteps(const Fit& fit, double family_wise, Selection* selection);

/// Drops small steps of single units without which the model does as well.
void DropNeedlessSteps(Fit* fit);

}  // namespace focalfleet::sim
