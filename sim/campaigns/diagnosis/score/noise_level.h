// The level of the noise in the scores of a pass. Most templates explain nothing: the noise that
// they take up says how large it is, and how far it differs from template to template. Sums over
// many units need to know both to a hundredth.
// Source: Efron, Large-Scale Inference, 2010, chapter 6 (an empirical null).
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/score/score.h"

namespace focalfleet::sim {

/// Chi-square of units' own amplitudes where there is nothing but noise.
struct NoiseLevel {
  double mean = 1;    // for each degree of freedom; at most 1, as noise is fitted
  double excess = 1;  // its variance, in that of chance; at least 1
};

/// The level that most of the templates share. Fewer than 20 templates have that of chance. Cost:
/// O(templates units).
NoiseLevel LevelOf(const std::vector<Score>& scores, const Templates& templates,
                   const ParallelFor& parallel);

/// Whether the template belongs to the plate or its image, and no unit has it alone.
bool IsOfTheWhole(const Template& form);

}  // namespace focalfleet::sim
