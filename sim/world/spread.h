// The spread of units about their description. Nominal units do not differ from it, except in the
// phase of the load over a turn and in the clock. Real units have the spread measured on robots in
// service (a focal plane of 5000, 2021). The figures are: backlash 1.4-1.6 deg, periodic error 0.1
// deg, step scatter 0.09-0.14 deg, scale sd 0.3 %, 8.5 % of units off scale, 4 % slipping or dead,
// arms sd 57 um, zero angles sd 0.5 deg. Every draw has a stream of its own by (seed, purpose, unit
// id). A unit therefore keeps its character when others are added or removed.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "sim/world/axis/axis.h"
#include "sim/world/mechanism.h"
#include "sim/world/unit_description.h"

namespace focalfleet::sim {

/// Nominal: quantisation and load-angle lag. Real: also the spread measured on robots in service.
enum class Spread : std::uint8_t { kNominal, kReal };

/// The constant traits of one unit.
struct UnitTraits {
  std::array<AxisTraits, kAxisCount> axis;
  Mechanism mechanism;
  UnitClock clock;
};

/// A single way in which the units differ from their description, for tests of the diagnosis. Each
/// is a cause of docs/diagnosis.md, drawn for each unit with a size of its own.
enum class PlantedCause : std::uint8_t {
  kZeroOffset,    // zero angle, standard deviation in degrees
  kArmLength,     // standard deviation in mm
  kGearScale,     // standard deviation, a share
  kBacklash,      // full width in degrees, the same for all
  kEccentricity,  // amplitude in degrees, the same for all; the phase is the unit's own
};
inline constexpr std::array<const char*, 5> kPlantedCauseNames{
    "zero_offset", "arm_length", "gear_scale", "backlash", "eccentricity"};
struct PlantedTrait {
  PlantedCause cause = PlantedCause::kZeroOffset;
  std::array<bool, kAxisCount> on_axis{true, true};
  double size = 0;
};

struct TraitsOptions {
  std::uint64_t seed = 1;
  Spread spread = Spread::kNominal;
  double clock_error_max = 0;
  std::int32_t subdivision = 96;
  std::vector<PlantedTrait> planted = {};  // on top of the spread
};
UnitTraits DrawTraits(const UnitDescription& description, const TraitsOptions& options);

/// The range's ends and home in whole vectors, as the factory writes them: home is phi's upper and
/// theta's lower end.
struct FactoryRange {
  std::int32_t min_position = 0;
  std::int32_t max_position = 0;
  std::int32_t home_position = 0;
};
FactoryRange FactoryRangeOf(const AxisDescription& axis, Axis which, std::int32_t subdivision);

/// The first pose of the axes: as described, or folded back. Folded back, theta stands in the
/// middle of its range, and phi as near to phi + phi_zero = 180 degrees as it gets. A disabled unit
/// stands anywhere with phi + phi_zero >= 120.
std::array<double, kAxisCount> FirstPoseDeg(const UnitDescription& description, std::uint64_t seed);

}  // namespace focalfleet::sim
