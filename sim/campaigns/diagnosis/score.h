// Signatures of all templates against the residuals of a fit. The signature of a template is the
// displacement that its effect makes per unit of amplitude at the same commands and conditions,
// [sim(+e) - sim(-e)] / 2e; it is whitened like the data, and what static geometry (and the terms
// that are in the model already) can absorb is projected out (Frisch and Waugh). All that is kept
// of it per unit are b = M'y and G = M'M; sums over units score it for a rail, a bus, the fleet.
//
// Signatures are made anew in each pass and never stored: 5000 units x 250 moves x 400 templates
// would be 8 GB. A pass costs some 40 ns a move and template.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// One template's score. c: its columns.
struct Score {
  std::vector<double> b;         // Shape: (units, c)
  std::vector<double> g;         // Shape: (units, c, c)
  std::vector<double> target_b;  // Shape: (units, c): against the left-out term's own signal
  // The same summed over units, exposure by exposure: what noise that units share looks like.
  std::vector<double> exposure_b;  // Shape: (exposures, c)
  std::vector<double> exposure_g;  // Shape: (exposures, c, c)
  // The sum over the fleet with the model's shared terms projected out.
  Eigen::VectorXd fleet_b, fleet_target_b;
  Eigen::MatrixXd fleet_g;
  // Squared length before anything was projected out; of what plate or camera own, without what
  // shifts a unit as a whole.
  double raw = 0;
  double kept = 0;        // and after
  double spread_sum = 0;  // dispersion of the units' scores about their own fits, summed
  double spread_count = 0;
};

struct ScorePass {
  std::vector<Score> scores;   // Shape: (templates)
  double target_square = 0;    // squared length of the left-out term's signal, projected
  double residual_square = 0;  // of the data
  std::size_t values = 0;      // whitened numbers in the data
};

/// Whether the amplitude that fits best, (g)^-1 b, is for sure beyond what physics allows.
bool IsImpossible(const Template& form, const Eigen::Ref<const Eigen::VectorXd>& b,
                  const Eigen::Ref<const Eigen::MatrixXd>& g);

inline constexpr std::size_t kNoTerm = SIZE_MAX;

/// Scores the templates against the residuals; with `without`, as if that term of the model were
/// not in it, and against its signal too.
ScorePass ScoreTemplates(const Fit& fit, const Templates& templates, std::size_t without = kNoTerm);

/// The same for several left-out terms (or kNoTerm) of one state of the fit: signatures are made
/// and whitened once for all of them. Shape: (withouts).
std::vector<ScorePass> ScoreWithouts(const Fit& fit, const Templates& templates,
                                     std::span<const std::size_t> withouts);

}  // namespace focalfleet::sim
