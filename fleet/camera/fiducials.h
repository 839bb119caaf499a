// Finds the spots of the fiducials when the camera is only roughly where it should be. A pair of
// fiducials far apart and a pair of spots near where these are expected give a similarity. The
// right similarity puts a spot on nearly every fiducial, a wrong one on about one in a hundred. (A
// plate has one spot in some 500 mm^2; the tolerance circle has some 7 mm^2.) Pairs are therefore
// tried, widest first, until one gathers most fiducials; missing, false and extra spots only cost
// further tries.
#pragma once

#include <complex>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <vector>

#include "fleet/camera/spot_grid.h"
#include "fleet/camera/spots.h"

namespace focalfleet {

/// Bounds of the camera's difference from its model. An alignment beyond them is refused by name;
/// the search goes up to three times as far.
struct CameraBounds {
  double shift_mm_max = 5;  // at the plate
  double rotation_deg_max = 0.2;
  double scale_max = 2e-3;         // relative
  double distortion_mm_max = 1.5;  // left by the model after the best similarity
};

struct FiducialMatch {
  std::uint32_t fiducial = 0;  // row
  std::uint32_t spot = 0;      // row
};

/// plate = gain * w + shift, with w the place by the model. Complex: x + i y, mm.
struct Alignment {
  std::complex<double> gain{1, 0};
  std::complex<double> shift{0, 0};
  std::vector<FiducialMatch> matches;  // nearest spot of each fiducial that has one
};

/// The best similarity found. Empty: fewer than half of the fiducials (or three) have a spot.
/// `seen_fp`: the spots by the model; `grid`: over them. Cost: usually one try (20 us for 120
/// fiducials); at most some 60 pairs, tens of ms.
std::optional<Alignment> FindFiducials(std::span<const Fiducial> fiducials,
                                       std::span<const PointFp> seen_fp, const SpotGrid& grid,
                                       const CameraBounds& bounds);

/// The reason why an alignment is refused. Empty: it is within bounds.
std::optional<Refusal> OutOfBounds(const Alignment& alignment, const CameraBounds& bounds);

}  // namespace focalfleet
