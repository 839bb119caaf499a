#include "sim/world/metrology.h"

namespace focalfleet::sim {

std::vector<Spot> Expose(const World& world, const CameraError& error, Rng* rng) {
  std::vector<Spot> spots;
  spots.reserve(world.units().size());
  for (std::size_t row = 0; row < world.units().size(); ++row) {
    const UnitTruth truth = world.Truth(row);
    Spot spot{truth.id, truth.x_mm, truth.y_mm};
    if (error.centroid_sigma_mm > 0) {
      spot.x_mm += error.centroid_sigma_mm * rng->Normal();
      spot.y_mm += error.centroid_sigma_mm * rng->Normal();
    }
    spots.push_back(spot);
  }
  return spots;
}

}  // namespace focalfleet::sim
