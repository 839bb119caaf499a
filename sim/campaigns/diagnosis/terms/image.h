// The common motion of all fibres of one exposure is shift, turn and scale of the image (camera).
// Neighbours may have more in common (air).
#pragma once

#include <optional>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {

struct ImageFound {
  bool moves = false;  // the model has changed
  /// camera_similarity, or air_turbulence where neighbours agree beyond the image's motion. Air is
  /// also a candidate where the motion is new at each exposure.
  std::optional<CauseFound> cause;
  /// The column that the shifts follow; there is no cause then. A single slow wave of time that
  /// only shifts is the camera's and unknown: the camera moves, or the plate before it.
  std::optional<UnknownFound> followed;
  double drift_um = 0;  // of an image that goes on from one exposure to the next
};

/// Fits shift, turn and scale of each exposure to the residuals where chance does not explain them.
/// The model has them in place of steps of the whole image.
ImageFound AddImageTerms(Fit* fit, double family_wise);

/// Adds the drift of the image as a rival of terms whose column drifts as well: the drift may
/// explain their effect on the image.
void AddDriftAsRival(double drift_um, const Fit& fit, Selection* selection);

}  // namespace focalfleet::sim
