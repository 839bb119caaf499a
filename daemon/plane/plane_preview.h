// A preview of a plane: the first round of a configuration that is only planned.
#pragma once

#include <vector>

#include "fleet/coordinate/preview.h"
#include "fleet/drive.h"

namespace focalfleet {

/// The job for the planner with which an `apply` of the same file would begin. All lists are by
/// the plane's positions.
struct PlanePreview {
  Preview preview;
  std::vector<UnitDrive> drives;
};

}  // namespace focalfleet
