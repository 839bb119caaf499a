// What all fibres of one exposure have in common: shift, turn and scale of the image (camera), and
// what neighbours have in common beyond that (air).
#pragma once

#include <optional>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {

/// Fits shift, turn and scale of each exposure to the residuals where chance does not explain
/// them, adds them to the model and returns the cause: camera_similarity, or air_turbulence where
/// neighbours still agree after it.
/// A column that the image's shifts follow is added to `unknown`, and nothing is named.
std::optional<CauseFound> AddImageTerms(Fit* fit, double family_wise,
                                        std::vector<UnknownFound>* unknown);

}  // namespace focalfleet::sim
