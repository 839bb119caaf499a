// What all fibres of one exposure have in common: shift, turn and scale of the image (camera), and
// what neighbours have in common beyond that (air).
#pragma once

#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"
#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

struct ImageFound {
  bool moves = false;  // the model has changed
  /// camera_similarity, or air_turbulence where neighbours agree beyond the image's motion; the
  /// latter as a candidate where the image forgets from exposure to exposure.
  std::optional<CauseFound> cause;
  /// The column that the shifts follow: then there is no cause. One slow wave of time that only
  /// shifts is the camera's and unknown: something moves the camera, or what it looks at.
  std::optional<UnknownFound> followed;
  double drift_um = 0;  // of an image that goes on from one exposure to the next
};

/// Fits shift, turn and scale of each exposure to the residuals where chance does not explain them,
/// and adds them to the model in place of steps of the whole image.
ImageFound AddImageTerms(Fit* fit, double family_wise);

/// An image that drifts on may do what a column that drifts as well seems to do to it.
void AddDriftAsRival(double drift_um, const Fit& fit, Selection* selection);

}  // namespace focalfleet::sim
