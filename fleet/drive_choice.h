// The choice of bus voltage and drive setting for a whole fleet, from tables of what each axis
// costs at each candidate. Both axes of a unit have one setting, and all units of a rail have one
// voltage.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "fleet/layout.h"

namespace focalfleet {

/// The cost of an axis' move at one candidate.
struct AxisCost {
  bool tuned = false;  // false: the axis is refused there, and the rest says nothing
  double move_s = 0;
  double move_J = 0;
};

struct DriveCandidate {
  double v_bus_V = 0;
  std::vector<AxisCost> axes;  // Shape: (2 n), unit by unit, theta before phi
};

enum class Minimise : std::uint8_t { kTime, kEnergy };

/// The candidate of each unit, as its index. A rail has the voltage that costs its units least in
/// sum; a unit has the candidate of that voltage that costs it least. A unit costs the energy of
/// both axes, or the time of the slower one. Fewer refused axes come before any cost; the first of
/// equal candidates, and the lower of equal voltages, is chosen.
/// Shape: as `rails`, the rail of each unit. Pre: there is a candidate, and each has the axes of
/// all units. Cost: units times candidates times voltages.
std::vector<std::size_t> ChooseDrives(std::span<const RailId> rails,
                                      std::span<const DriveCandidate> candidates,
                                      Minimise minimise);

}  // namespace focalfleet
