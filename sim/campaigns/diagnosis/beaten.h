// Some names are beaten by an empirical term. Enough bumps and waves at one angle add up to any
// ripple. Their names are then worth no more than the ripple's order. Hours, warmth, wear and volts
// drift together over a night, so that the name of one of them may stand for what follows another
// column.
#pragma once

#include <cstdint>

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Drops names that an empirical term beats, both at their price. The first kind are terms that
/// depend on where an axis stands. Two or more of them are dropped where one ripple or curve of
/// that axis' angle predicts better than they do together. The second kind are terms that drift
/// with the night: each is dropped where a curve over any column predicts clearly better. The
/// screen then finds what they had explained.
void DropBeaten(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection);

}  // namespace focalfleet::sim
