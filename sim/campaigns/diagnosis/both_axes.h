// A cause that has one amplitude for both axes is one template; one that has its own on each axis
// is two, and neither does alone what the other cause does. So who is of both axes is held against
// pairs, too, by fitting them: what two axes do to a fibre is not independent, and evidence does
// not add up.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/evidence.h"

namespace focalfleet::sim {

/// A fit with a cause on each axis in the place of all shapes of one of both.
struct PairTrial {
  std::string_view cause;
  double log_p = 0;   // of the axis that chance explains better
  double behind = 0;  // twice the difference of the logarithms of likelihood, at their price
  /// Whether it explains more than chance gives to as many amplitudes as it has more.
  bool beyond_chance = false;
  /// `behind` without the price of the amplitudes that it has more, where they are two at most:
  /// that there are as many decides nothing. Else `behind`.
  double behind_by_likelihood = 0;
  Fit fit;
};

/// The most promising pairs in the place of a term of both axes; empty where it is of one, or none
/// comes near. `pass`, `evidence_of`: of the templates, without the term. `kept_min`: of a
/// signature, beside geometry and model.
std::vector<PairTrial> TryPairs(const Fit& fit, std::size_t term, const ScorePass& pass,
                                const Templates& templates,
                                const std::vector<Evidence>& evidence_of, const FleetGroups& groups,
                                double kept_min);

}  // namespace focalfleet::sim
