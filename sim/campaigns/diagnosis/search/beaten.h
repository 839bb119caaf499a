// Several names of one axis are one explanation of its errors, and an empirical term is another.
// Enough bumps and waves at one angle add up to any ripple. Where an empirical term predicts better
// than the names together, all at their price, they are worth no more than its column. Where it
// comes near, its odds are a doubt of theirs.
#pragma once

#include <cstdint>

#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {

/// Drops the names of an axis, two or more, that an empirical term beats. The screen then finds
/// what they had explained. Other such names get the term's odds (Accepted::log_odds_of_curve),
/// unless one of them alone does as well as the term. Cost: a screen and a fit for each name.
void DropBeaten(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection);

}  // namespace focalfleet::sim
