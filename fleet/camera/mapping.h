// First half of Identify: from pixels to the plate, or a refusal. The map uses fiducials and units
// that stand still, before any spot is assigned.
#pragma once

#include "fleet/camera/identify.h"

namespace focalfleet {

struct MappedSpots {
  std::vector<PointFp> at_fp;    // Shape: as the exposure's spots
  std::vector<double> sigma_mm;  // of the map, one coordinate
  std::vector<bool> is_fiducial;
};

/// The turn of the picture before the model is applied: quarters of a turn, then mirrored or not.
struct Orientation {
  int quarters = 0;
  bool mirrored = false;
};

/// Maps every spot and fills the fields of `result` that describe the camera.
tl::expected<MappedSpots, Refusal> MapSpots(const IdentificationRequest& request,
                                            const IdentifyOptions& options, Orientation orientation,
                                            Identification* result);

}  // namespace focalfleet
