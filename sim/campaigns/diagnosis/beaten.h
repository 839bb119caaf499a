// Names that an empirical term beats. Several parts at one angle: bumps and waves enough add up to
// any ripple, so that their names are worth no more than the ripple's order. What drifts over a
// night: hours, warmth, wear and volts go together, so that a name of one of them passes for what
// follows another column.
#pragma once

#include <cstdint>

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// Takes out the terms that depend on where an axis stands, where one empirical ripple or curve of
/// that axis' angle predicts better than two or more of them do together, and each term that drifts
/// with the night, where an empirical curve over whatever column predicts clearly better; both at
/// their price. What they named is left for the screen to find.
void DropBeaten(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection);

}  // namespace focalfleet::sim
