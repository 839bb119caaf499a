// The misfit artefacts of a strong cause may be in the model under other names. They improve the
// fit of the strong cause as it is. A rival that is as near the truth then loses only because they
// do not suit it.
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
