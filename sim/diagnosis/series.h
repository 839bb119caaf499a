// Several parts at one angle, or one ripple that no part of the library makes? Bumps and waves
// enough add up to any ripple, so that their names are worth no more than the ripple's order.
#pragma once

#include <cstdint>

#include "sim/diagnosis/select.h"

namespace focalfleet::sim {

/// Takes out the terms that depend on where an axis stands, where one empirical ripple or curve of
/// that axis' angle predicts better than two or more of them do together, at its price. What they
/// named is left for the screen to find.
void DropSeries(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection);

}  // namespace focalfleet::sim
