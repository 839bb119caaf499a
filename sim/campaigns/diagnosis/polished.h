// What the shape of a strong cause leaves is in the model, under other names. There it polishes the
// strong one: a rival that is as near the truth has all of it against itself.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Asks who else a cause could be without its misfit artefacts in the model; they become
/// candidates.
void ReassessWithoutMisfitArtefacts(const Templates& templates, const SelectionRule& rule,
                                    const Fit& fit, std::vector<CauseFound>* causes);

}  // namespace focalfleet::sim
