// Metrology gives the place of every fibre as a camera over the focal plane sees it, with the
// camera's own error where one is asked for. The camera sees fibres and no shafts, and it cannot
// see which units have power.
#pragma once

#include <vector>

#include "protocol/base/rng.h"
#include "sim/world/world.h"

namespace focalfleet::sim {

struct Spot {
  UnitId unit;
  double x_mm = 0;
  double y_mm = 0;
};

struct CameraError {
  double centroid_sigma_mm = 0;  // of one coordinate; 1-3 um on instruments in service
};

/// An exposure at world.now(). Frame: focal plane. Shape: as world.units(). The rng gives the
/// centroid noise.
std::vector<Spot> Expose(const World& world, const CameraError& error, Rng* rng);

}  // namespace focalfleet::sim
