// A plate of units is made from a count and a type of positioner, on a hexagonal lattice filled
// from the centre. Supply rails are sectors of the plate and buses are stripes across it. An effect
// of a rail therefore never looks like one of a bus.
#pragma once

#include <vector>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/campaign.h"

namespace focalfleet::hidden {

enum class PositionerType : std::uint8_t { kEqualLong, kEqualShort, kLongPhi };

/// Ids from 1 in random steps. Units: mm, deg. Cost: O(n log n).
std::vector<Unit> MakePlate(PositionerType type, std::size_t count, Rng* rng, double* pitch_mm);

/// Units within 1.3 pitches of each, by index.
std::vector<std::vector<std::size_t>> Neighbours(const Campaign& campaign);

}  // namespace focalfleet::hidden
