// Runs a campaign through a set of effects: where every fibre truly is in every picture. Without
// effects that is where the shared kinematics put it, to the last bit.
#pragma once

#include <span>
#include <vector>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

/// What no cause stands for: the true geometry, and the scatter of each axis's rest.
struct Truth {
  std::vector<Geometry> geometry;  // by unit
  ByAxis actuation_sigma_deg{};    // 0: none; new whenever the axis moves, kept while it rests
  std::uint64_t seed = 0;
};

/// The geometry of units.csv and no scatter.
Truth Believed(const Campaign& campaign);

Scene MakeScene(const Campaign& campaign);

/// Shape: (moves), for each of `units`. Cost: O(moves * effects) a unit, some 0.1 to 100 us a move.
std::vector<std::vector<Place>> RunPlant(const Scene& scene, const Truth& truth,
                                         std::span<const Effect> effects,
                                         std::span<const std::size_t> units);

/// 0..n-1.
std::vector<std::size_t> AllUnits(const Campaign& campaign);

}  // namespace focalfleet::hidden
