// Paper 2, claim by claim, on magnets whose field is computed. The claims are steepest angles,
// slopes, precision, the errors of its models and of those here, and the range of its sensors. The
// curves are those of its figures 4, 5, 6 and 8. The paper gives no dimensions, so the magnets have
// a stated geometry (magnet_array.h) whose fitted widths come near to the paper's. Claims that rest
// on that choice are `fitted`.
#pragma once

#include "sim/drive/reproduction/claim.h"
#include "sim/hall/magnet_array.h"

namespace focalfleet::sim {

struct HallReproduceOptions {
  double noise_T = 5e-4;
  double tilt_deg = 12;
  std::uint64_t seed = 1;
};

/// Cost: some seconds.
Reproduction ReproduceHall(const HallReproduceOptions& options);

}  // namespace focalfleet::sim
