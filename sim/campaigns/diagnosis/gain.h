// What the extended model is worth on moves that no fit has seen: the campaign's exposures are
// split into folds; for each fold the static geometry alone, and the geometry with the model's
// terms, are fitted to the others and judged on it. Where units are homed several times a fold is
// whole homings.
#pragma once

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// Pre: fit has the final model. Rows that are outliers of the final model are not judged.
/// `as_named`: where names of fibres were exchanged, the static fit under the names that the table
/// has; their rows are as far off before as they are under these. nullptr: none were.
HeldOutGain MeasureGain(const Fit& fit, const Fit* as_named = nullptr);

/// Root mean square of the noise that the fit found, two-dimensional, um.
double NoiseFloor(const Fit& fit);

}  // namespace focalfleet::sim
