// A focal plane made from a count and a pitch alone: units on a hexagonal lattice, nearest the
// centre first. The proportions are those of LAMOST: the fibre reaches 16.5 mm at 25.6 mm pitch, so
// that the patrol discs leave no gap. The gears are those of paper 1. Supplies and buses are
// compact regions of the plate, as harnesses are.
#pragma once

#include <cstdint>
#include <vector>

#include "fleet/layout.h"

namespace focalfleet {

/// Motor turns per turn of either axis.
inline constexpr double kHexLayoutGear = 337.0 * 45 / 17;

struct HexLayoutOptions {
  std::uint32_t count = 0;
  double pitch_mm = 25.6;
  double theta_arm_mm = 0;  // 0: as LAMOST's, 8.25 at 25.6 mm pitch
  double phi_arm_mm = 0;    // 0: as long as the theta arm
  std::uint32_t units_per_bus = 100;
  std::uint32_t units_per_rail = 500;
  std::uint32_t fiducials = 0;
  std::uint8_t sensors = 0;  // Hall sensors at each unit's joint
  double carrier_mm = 0;     // where it has any; 0: twice both arms
};

/// SDSS-V's proportions: arms of 7.4 and 14.3 mm at 22.4 mm pitch, so that a fibre reaches its
/// neighbour's base.
inline HexLayoutOptions SdssLike(std::uint32_t count) {
  return {.count = count, .pitch_mm = 22.4, .theta_arm_mm = 7.4, .phi_arm_mm = 14.3};
}

/// Exactly `count` units, ids from 1, nearest the centre first; nodes are numbered on each bus in
/// that order. Frame: focal plane, the centre unit at 0, 0. Cost: O(n log n).
std::vector<Unit> MakeHexLayout(const HexLayoutOptions& options);

struct HexPlate {
  std::vector<Unit> units;
  std::vector<Fiducial> fiducials;
};

/// Units and fiducials, ids from 1 each. No arm reaches a fiducial. On the lattice of LAMOST's
/// proportions every gap is reached. Fiducials therefore take places of the lattice, evenly over
/// the plate, and the units fill the others. Where neighbours' arms reach an empty place, too (as
/// SDSS-V's do), fiducials stand on a ring outside all patrol areas. Either way they follow the
/// golden angle (a sunflower's seeds), so that no turn or reflection of the plate maps them onto
/// themselves.
HexPlate MakeHexPlate(const HexLayoutOptions& options);

}  // namespace focalfleet
