// First half of Identify: from pixels to the plate, or a refusal. Knows fiducials and units that
// stand still, not yet who is who.
#pragma once

#include "fleet/camera/identify.h"

namespace focalfleet {

struct MappedSpots {
  std::vector<PointFp> at_fp;    // Shape: as the exposure's spots
  std::vector<double> sigma_mm;  // of the map, one coordinate
  std::vector<bool> is_fiducial;
};

/// Quarters of a turn, then mirrored or not: how the picture is turned before the model is applied.
struct Orientation {
  int quarters = 0;
  bool mirrored = false;
};

/// Fills the fields of `result` that tell about the camera.
tl::expected<MappedSpots, Refusal> MapSpots(const IdentificationRequest& request,
                                            const IdentifyOptions& options, Orientation orientation,
                                            Identification* result);

}  // namespace focalfleet
