// A patch corrects what no cause explains. An empirical term is added for the clearest structure
// that the screen finds, then for the next, until chance explains what is left. A term is a curve
// of all cosines over the column, or the ripple of the order. The whole model is fitted anew with
// each. A patch names nothing: the verdict stays "unknown", and held-out moves measure what the
// patch is worth.
#pragma once

#include <cstdint>
#include <vector>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

inline constexpr std::size_t kPatchTermsMax = 4;

struct PatchRule {
  double family_wise = 0.01;
  std::uint64_t seed = 1;
};

/// Adds terms to the fit's model for structures that no cause explains. Where the image's shifts
/// follow a column, curves in x and y take their place, and the entry of `reported` is marked as
/// patched. Returns the structures that the screen found, each marked where a term was added for
/// it.
std::vector<UnknownFound> PatchStructures(const PatchRule& rule,
                                          std::vector<UnknownFound>* reported, Fit* fit);

}  // namespace focalfleet::sim
