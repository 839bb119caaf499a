// Whether steps could stand where a cause does. What one unit does from its first short move on is
// a mode_threshold or a slip at that move, to the last row: where a cause lives in few units, they
// are fitted once more without it and with what steps then stand out. And the other way round: a
// small step that was taken while the causes were not yet known may be one of theirs.
#pragma once

#include "sim/campaigns/diagnosis/fit.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// step_loss or lost_command as rivals of the terms in few units that steps explain as well, though
/// not for their price.
void CompareWithSteps(const Fit& fit, Selection* selection);

/// Takes out small steps of single units that the model does as well without.
void DropNeedlessSteps(Fit* fit);

}  // namespace focalfleet::sim
