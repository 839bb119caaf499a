// The evidence for a template says at which level its amplitudes are shared, how much it explains,
// and whether that could be chance.
//
// Evidence is the ratio of the marginal likelihoods with the effect and without. Amplitudes may
// have any size near the effect's prior size: ln Z = 1/2 b' (G + 1/a^2)^-1 b - 1/2 ln|1 + a^2 G|. A
// free amplitude for every unit pays for itself or loses to one amplitude for all. Units that have
// the effect among units that have not are a mixture with unknown share. A shape of the unit's own
// costs the logarithm of the number of shapes to choose from. Chance is the tail of chi-square for
// the best of the levels, with the dispersion of the actual residuals.
#pragma once

#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/score/fleet_groups.h"
#include "sim/campaigns/diagnosis/score/noise_level.h"
#include "sim/campaigns/diagnosis/score/score.h"

namespace focalfleet::sim {

struct Evidence {
  Sharing sharing = Sharing::kFleet;
  std::vector<char> has;    // Shape: (units)
  double log_evidence = 0;  // of the marginal likelihood ratio, natural
  double chi_square = 0;    // explained at that level, by the units that have it
  double log_p = 0;         // the least of all levels, corrected for their number
  double dispersion = 1;    // of the noise along this template
  double spread = 0;        // of the units' amplitudes about 0, or about a mean (scattered)
  bool scattered = false;   // units' own amplitudes about a mean of the fleet
};

/// The evidence for the template at its best level. Pre: score belongs to form.
Evidence Assess(const Score& score, const Template& form, const FleetGroups& groups,
                const NoiseLevel& noise = {});

/// Dispersion of the fleet's score about its fit, from exposure to exposure.
double FleetDispersion(const Score& score, std::size_t columns);

/// Share of the left-out term's signal that this template can take over at the given level, 0..1.
double ShareOfTarget(const Score& score, const Template& form, const Evidence& as,
                     const FleetGroups& groups, double target_square);

/// The number of independent tests that the templates are worth, from exposures' signs flipped at
/// random.
double EffectiveTests(const std::vector<Score>& scores, const Templates& templates,
                      std::uint64_t seed);

}  // namespace focalfleet::sim
