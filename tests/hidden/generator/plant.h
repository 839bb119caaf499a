// The plant runs a campaign through a set of effects and gives every fibre's true place in every
// picture. Without effects these are the places of the shared kinematics, to the last bit.
#pragma once

#include <span>
#include <vector>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

/// The true state beside the causes: geometry, and the scatter of each axis's rest.
struct Truth {
  std::vector<Geometry> geometry;  // by unit
  ByAxis actuation_sigma_deg{};    // 0: none; new whenever the axis moves, kept while it rests
  std::uint64_t seed = 0;
};

/// The geometry of units.csv and no scatter.
Truth Believed(const Campaign& campaign);

Scene MakeScene(const Campaign& campaign, Physics physics = Physics::kMechanisms);

/// The true places. Shape: (moves), for each of `units`. Cost: O(moves * effects) a unit, some 0.1
/// to 100 us a move.
std::vector<std::vector<Place>> RunPlant(const Scene& scene, const Truth& truth,
                                         std::span<const Effect> effects,
                                         std::span<const std::size_t> units);

/// The indices 0..n-1.
std::vector<std::size_t> AllUnits(const Campaign& campaign);

}  // namespace focalfleet::hidden
