// Scores compare the signatures of all templates with the residuals of a fit. The signature of a
// template is the displacement per unit of amplitude at the same commands and conditions, [sim(+e)
// - sim(-e)] / 2e. Signatures are whitened like the data. The part that static geometry and the
// model's present terms can absorb is projected out (Frisch and Waugh). Only b = M'y and G = M'M
// are kept of it per unit. Sums over units score it for a rail, a bus, the fleet.
//
// Signatures are made anew in each pass and never stored: 5000 units x 250 moves x 400 templates
// would be 8 GB. A pass costs some 40 ns a move and template.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The score of a template. c: its columns.
struct Score {
  std::vector<double> b;         // Shape: (units, c)
  std::vector<double> g;         // Shape: (units, c, c)
  std::vector<double> target_b;  // Shape: (units, c): against the left-out term's own signal
  // The same summed over units, exposure by exposure: noise that units share shows in it.
  std::vector<double> exposure_b;  // Shape: (exposures, c)
  std::vector<double> exposure_g;  // Shape: (exposures, c, c)
  // The sum over the fleet with the model's shared terms projected out.
  Eigen::VectorXd fleet_b, fleet_target_b;
  Eigen::MatrixXd fleet_g;
  // Squared length before anything was projected out. For a template that plate or camera own,
  // without the shift of each unit as a whole.
  double raw = 0;
  double kept = 0;        // squared length afterwards
  double spread_sum = 0;  // dispersion of the units' scores about their own fits, summed
  double spread_count = 0;
};

struct ScorePass {
  std::vector<Score> scores;   // Shape: (templates)
  double target_square = 0;    // squared length of the left-out term's signal, projected
  double residual_square = 0;  // of the data
  std::size_t values = 0;      // whitened numbers in the data
};

/// The part of a unit's residuals that amplitudes of its own explain.
struct OwnFit {
  double chi_square = 0;
  double freedom = 0;  // directions that the data show
};
OwnFit FitOwn(const Score& score, std::size_t columns, std::size_t unit);

/// Whether the amplitude that fits best, (g)^-1 b, is clearly beyond what physics allows.
bool IsImpossible(const Template& form, const Eigen::Ref<const Eigen::VectorXd>& b,
                  const Eigen::Ref<const Eigen::MatrixXd>& g);

inline constexpr std::size_t kNoTerm = SIZE_MAX;

/// Scores the templates against the residuals. With `without`, that term of the model is left out,
/// and its signal is scored too.
ScorePass ScoreTemplates(const Fit& fit, const Templates& templates, std::size_t without = kNoTerm);

/// The same for several left-out terms (or kNoTerm) of one state of the fit: signatures are made
/// and whitened once for all of them. Shape: (withouts).
std::vector<ScorePass> ScoreWithouts(const Fit& fit, const Templates& templates,
                                     std::span<const std::size_t> withouts);

}  // namespace focalfleet::sim
