// The names of a fitted model's parts: its events, its terms and its fitted geometry become causes.
// Causes of one name are merged, and doubtful ones are judged beside the stronger ones (families.h).
#pragma once

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Adds the model's causes to `diagnosis`, the strongest first, and what no cause explains to its
/// unknown structures and outliers.
void NameCauses(const Fit& fit, const Selection& selection, const DiagnoseOptions& options,
                Diagnosis* diagnosis);

/// `cause` has the units of `more` as well, each once and in ascending order.
void AddUnits(const CauseFound& more, CauseFound* cause);

}  // namespace focalfleet::sim
