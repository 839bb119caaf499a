// What all fibres of one exposure have in common: shift, turn and scale of the image (camera), and
// what neighbours have in common beyond that (air).
#pragma once

#include <optional>
#include <string_view>
#include <vector>

#include "sim/diagnosis/diagnosis.h"
#include "sim/diagnosis/fit.h"

namespace focalfleet::sim {

/// How the channel of what the image's shifts follow begins.
inline constexpr std::string_view kImageShift = "the image's shift";

struct ImageFound {
  bool moves = false;  // the model has changed
  /// camera_similarity, or air_turbulence where neighbours agree beyond the image's motion; the
  /// latter as a candidate where the image forgets from exposure to exposure.
  std::optional<CauseFound> cause;
  std::optional<UnknownFound>
      followed;  // the column that the shifts follow: then there is no cause
};

/// Fits shift, turn and scale of each exposure to the residuals where chance does not explain them,
/// and adds them to the model in place of steps of the whole image.
ImageFound AddImageTerms(Fit* fit, double family_wise);

}  // namespace focalfleet::sim
