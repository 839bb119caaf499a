// The screen finds structure that no effect of the library explains. The screen examines the
// residuals along each axis' angle and each direction of the plate, with and without the direction
// of motion. The looks are smooth curves over the ranks of every column of the table, and ripples
// of any order of either axis. They are templates like those of effects, so that they are scored,
// shared and gated the same way. Their finds are called empirical, never a cause.
#pragma once

#include <cstdint>
#include <optional>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

Templates ScreenTemplates(const CampaignFacts& facts);

/// Structure that chance does not explain.
struct StructureLeft {
  UnknownFound reported;
  ModelTerm term;    // the look that shows it best, as a single step fits it
  double tests = 1;  // independent looks
};

/// The clearest structure. nullopt where chance explains what is left, at a share of the
/// family-wise rate.
std::optional<StructureLeft> FindStructure(const Fit& fit, double family_wise, std::uint64_t seed);

/// Errors that all units have alike in a few exposures, along an angle. No smooth curve shows them.
/// nullopt where chance explains them, at a share of the family-wise rate.
std::optional<UnknownFound> FindOddExposures(const Fit& fit, double family_wise);

}  // namespace focalfleet::sim
