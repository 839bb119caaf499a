// A preview is the first round of a configuration that is only planned. Nothing of the fleet's
// state changes, and its plan never becomes the configuration. The answer therefore holds for the
// present places alone.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/goal.h"

namespace focalfleet {

struct Preview {
  struct Refused {
    PositionerIndex unit;
    std::string reason;
  };
  PlanJob job;  // its purpose is a preview
  std::uint32_t targeted = 0;
  std::vector<Refused> refused;  // targets that are settled before any planning; ascending
};

/// The job for the planner, and the targets that would not even reach it. Run-ups and corrections
/// are not planned. `start_skew_s`: see PlanOptions.
Preview PreviewOf(const Coordination& fleet, const Goal& goal, double start_skew_s);

}  // namespace focalfleet
