// Is there structure left that no effect of the library explains? The residual is looked at along
// each axis' angle and each direction of the plate, with and without the direction of motion,
// against every column of the table (smooth curves over its ranks) and against ripples of any
// order of either axis. The looks are templates like those of effects, so that they are scored,
// shared and gated the same way; what they find is called empirical, never a cause.
#pragma once

#include <cstdint>
#include <optional>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

Templates ScreenTemplates(const CampaignFacts& facts);

/// Structure that chance does not explain.
struct StructureLeft {
  UnknownFound reported;
  ModelTerm term;  // the look that shows it best, as one step fits it
};

/// The clearest. None: chance explains what is left, at a share of the family-wise rate.
std::optional<StructureLeft> FindStructure(const Fit& fit, double family_wise, std::uint64_t seed);

}  // namespace focalfleet::sim
