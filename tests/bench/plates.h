// The plates that plans are measured on: units, and what stands between and around them. None is a
// copy of an instrument; each has the proportions of one.
#pragma once

#include <cstdint>
#include <vector>

#include "fleet/hex_layout.h"
#include "fleet/layout.h"

namespace focalfleet::bench {

enum class PlateKind : std::uint8_t {
  kHexagonal,
  kFile,      // the units file that FOCALFLEET_DESI_UNITS names
  kSdssLike,  // arms of 7.4 and 14.3 mm at 22.4 mm pitch
  kPfsLike,   // arms of 2.375 and 2.375 mm at 8 mm pitch
  kMoonsLike  // arms of 8 and 17 mm at 25 mm pitch
};
inline constexpr int kPlateKinds = 5;

struct PlateOptions {
  PlateKind kind = PlateKind::kHexagonal;
  std::uint32_t count = 0;      // of units; a file has its own
  std::uint32_t obstacles = 0;  // fixed, each at the place of a unit, evenly over the plate
  bool rim = false;             // a fixed ring that the outermost units cannot stretch out over
};

struct Plate {
  std::vector<Unit> units;  // empty: the file cannot be read
  std::vector<Obstacle> obstacles;
};

Plate MakePlate(const PlateOptions& options);
const char* NameOf(PlateKind kind);

}  // namespace focalfleet::bench
