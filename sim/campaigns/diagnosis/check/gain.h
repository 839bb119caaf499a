// The gain of the extended model is measured on moves that no fit has seen. The campaign's
// exposures are split into folds. For each fold the static geometry alone, and the geometry with
// the model's terms, are fitted to the others and judged on it. Folds are dealt out in short
// blocks, so that each has its share of every condition.
#pragma once

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The gain of the fit's model. Rows that are outliers of the final model are not judged.
/// Pre: fit has the final model. `as_named`: where names of fibres were exchanged, the static fit
/// under the names of the table. Rows are as far off before, by these, as under the corrected
/// names. nullptr: no name was.
HeldOutGain MeasureGain(const Fit& fit, const Fit* as_named = nullptr);

/// Root mean square of the noise that the fit found, two-dimensional, um.
double NoiseFloor(const Fit& fit);

}  // namespace focalfleet::sim
