// Paper 2, claim by claim, on magnets whose field is computed: steepest angles, slopes, precision,
// errors of its models and of ours, its sensors' range; and its figures 4, 5, 6 and 8. The paper
// gives no dimensions, so the magnets are a stated geometry (magnet_array.h) whose fitted widths
// come near to the paper's; what rests on that choice is `fitted`.
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
