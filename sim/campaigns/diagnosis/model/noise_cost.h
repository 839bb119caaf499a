// The cost of a unit's residuals under a noise: minus the logarithm of the restricted likelihood.
// A search of the noise asks for it some hundred times for each unit of a sample.
// Source: Patterson and Thompson, Biometrika 58 (1971) 545.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/model/lanes.h"

namespace focalfleet::sim {

struct NoiseMove {
  bool restarts = false, theta_moves = false, phi_moves = false;
  bool seen = false;
  double x_um = 0, y_um = 0;
  double turn_um[4] = {0, 0, 0, 0};
  double exposure_factor = 1;
};
struct NoiseUnit {
  double factor = 1;
  std::vector<NoiseMove> moves;
  std::vector<double> turn_um;  // of the seen moves. Shape: (seen, 4)
  // Effects of the unit's own unknowns (geometry, own amplitudes, zeros), and after these the
  // residuals, eight columns side by side. Shape: (blocks, 2 seen).
  std::vector<Lanes> columns;
  std::size_t unknowns = 0;
};

/// Buffers that one evaluation after the other uses.
struct NoiseScratch {
  std::vector<RowFilter> rows;
  std::vector<Lanes> white;  // as NoiseUnit::columns
  Eigen::MatrixXd normal;
};

/// Displacements by the unit's own unknowns, each of length 1: geometry, own amplitudes, zeros of
/// homings. Before whitening. Shape: (2 used rows, unknowns).
Eigen::MatrixXd OwnDisplacements(const Fit& fit, std::size_t unit, const WhiteUnit& white);

/// Whole units, evenly from the fleet.
std::vector<NoiseUnit> SampleForNoise(const Fit& fit);

/// The density of each place given those before it, and the part that the unit's own unknowns have
/// absorbed, with these to second order about the residuals.
double CostOf(const NoiseUnit& unit, const Noise& noise, NoiseScratch* scratch);

}  // namespace focalfleet::sim
