// Parts of a fitted model get names: its events, its terms and its fitted geometry become causes.
// Causes of one name are merged.
#pragma once

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {

/// Adds the model's causes to `diagnosis`, the strongest first. Structures that no cause explains
/// go to its unknown structures and outliers.
void NameCauses(const Fit& fit, const Selection& selection, const DiagnoseOptions& options,
                Diagnosis* diagnosis);

/// Adds the units of `more` to those of `cause`, each once and in ascending order.
void AddUnits(const CauseFound& more, CauseFound* cause);

}  // namespace focalfleet::sim
