// What no cause explains can still be corrected: an empirical term for the clearest structure that
// the screen sees, then for the next, until chance explains what is left. A curve of all cosines
// over the column, or the ripple of the order; the whole model is fitted anew with each. It names
// nothing: the verdict stays "unknown", and held-out moves say what the patch is worth.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "sim/campaigns/diagnosis/diagnosis.h"
#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

inline constexpr std::size_t kPatchTermsMax = 4;

struct PatchRule {
  double family_wise = 0.01;
  std::uint64_t seed = 1;
  std::function<bool(const UnknownFound&)> matters = [](const UnknownFound&) { return true; };
};

/// Adds terms to the fit's model, for what matters. Where the image's shifts follow a column
/// (`told`, marked as patched then), curves in x and y take their place. Returns what the screen
/// saw, each entry marked where a term was added for it.
std::vector<UnknownFound> PatchStructures(const PatchRule& rule,
                                          std::vector<UnknownFound>* reported, Fit* fit);

}  // namespace focalfleet::sim
