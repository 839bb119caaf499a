// Misfit artefacts of a strong cause are in the model, under other names. There they polish the
// strong one: a rival that is as near the truth has all of them against itself.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Finds the rivals of each cause without its misfit artefacts in the model, and adds them as
/// candidates.
void ReassessWithoutMisfitArtefacts(const Templates& templates, const SelectionRule& rule,
                                    const Fit& fit, std::vector<CauseFound>* causes);

}  // namespace focalfleet::sim
