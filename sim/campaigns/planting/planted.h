// A planted campaign has chosen effects in it, for tests, load and demonstration. Units are on a
// hexagonal lattice. The moves are those of a diagnostic campaign: long and short, both ways, of
// single axes and of both. Few or many units move at once, at several drive levels, delays and
// temperatures. Places are measured with noise.
//
// The physics are those of the library. A test of the diagnosis that must not share them plants its
// own campaigns (tests/hidden).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/diagnosis/design/ahead.h"

namespace focalfleet::sim {

struct PlantedEffect {
  std::string cause;
  double amplitude = 0;     // in the effect's unit
  std::string axis;         // empty: the first that the effect has
  double unit_share = 1;    // of the units that have it
  double unit_scatter = 0;  // relative, of the units' own amplitudes
  // Index among the effect's templates on that axis. With -1 it is the first. Where shapes are
  // units' own, as damaged teeth are, each unit then has one of the first's kind.
  int form = -1;
};

struct PlantedOptions {
  std::size_t units = 60;
  std::size_t moves = 60;
  std::uint64_t seed = 1;
  double noise_um = 3;           // one coordinate of a measured place
  double rest_noise_deg = 0.01;  // of each axis, new at each of its moves, held until the next
  double zero_offset_deg = 0;    // of the true geometry against the table, as are the next two
  double base_offset_mm = 0;
  double arm_offset_mm = 0;
  double outlier_share = 0;  // rows that lie anywhere within 2 mm
  double lost_share = 0;     // rows that were not seen
  double homing_share = 0;   // of a unit's moves that begin with a homing
  bool pinion = true;        // gears of 337.36 x 45/17, else 337.36
  std::vector<PlantedEffect> effects;
  std::vector<PlateMove> next;  // made after the others, by the same units
};

/// A campaign with the effects, and with the causes of planted_faults.h, which are no effects. The
/// campaign has camera pixels where centroid_bias is planted.
/// Errors: kInvalid: an effect, axis or shape that does not exist.
Result<Campaign> PlantCampaign(const PlantedOptions& options);

}  // namespace focalfleet::sim
