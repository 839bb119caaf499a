// A cause with one amplitude for both axes is one template, and a cause with its own on each axis
// is two. A pair of templates for single axes cannot be replaced by one of them alone. Terms of
// both axes are therefore compared with pairs as well. The pairs are fitted, because the effects of
// two axes on a fibre are not independent, so that their evidence does not add up.
#pragma once

#include <cstddef>
#include <string_view>
#include <vector>

#include "sim/campaigns/diagnosis/score/evidence.h"

namespace focalfleet::sim {

/// A fit with a cause on each axis in place of all shapes of one of both.
struct PairTrial {
  std::string_view cause;
  double log_p = 0;   // of the axis that chance explains better
  double behind = 0;  // twice the difference of the log likelihoods, at their price
  /// Whether the pair explains more than chance gives to its additional amplitudes.
  bool beyond_chance = false;
  /// `behind` without the price of the additional amplitudes, where they are two at most: their
  /// number decides nothing. Else `behind`.
  double behind_by_likelihood = 0;
  Fit fit;
};

/// The most promising pairs in place of a term of both axes. Empty where the term is of one axis,
/// or where no pair comes near. `pass` and `evidence_of` are of the templates, without the term.
/// `kept_min` is the share of a signature that must be left beside geometry and model.
std::vector<PairTrial> TryPairs(const Fit& fit, std::size_t term, const ScorePass& pass,
                                const Templates& templates,
                                const std::vector<Evidence>& evidence_of, const FleetGroups& groups,
                                double kept_min);

}  // namespace focalfleet::sim
