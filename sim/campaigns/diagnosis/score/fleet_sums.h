// A pass over all templates sums what units say over the fleet, and exposure by exposure. Chunks of
// units are summed side by side, and their sums are added in the order of the chunks. Results thus
// do not depend on how many threads there are.
#pragma once

#include <Eigen/Dense>
#include <cstddef>
#include <span>
#include <vector>

#include "sim/campaigns/diagnosis/model/lanes.h"
#include "sim/campaigns/diagnosis/score/unit_scorer.h"

namespace focalfleet::sim {

/// The data that the units of a pass share.
struct PassPlan {
  const Fit& fit;
  const Templates& templates;
  std::span<const std::size_t> withouts;
  std::vector<Block> blocks;
  SharedColumns shared;
};

/// Sums of one template. c: its columns; exposures: those of the FleetSums.
struct TemplateSums {
  double raw = 0, kept = 0, spread_sum = 0, spread_count = 0;
  std::vector<double> exposure_g;  // empty where c = 1. Shape: (exposures, c, c)
};

struct LookSums {
  std::vector<TemplateSums> of_template;
  std::vector<Lanes> exposure_b, exposure_g;  // Shape: (blocks, exposures)
  std::vector<Lanes> shared_cross;            // shared' M. Shape: (blocks, shared columns of all)
  Eigen::MatrixXd shared_g;
  Eigen::VectorXd shared_b, shared_target_b;
  double target_square = 0, residual_square = 0;
  std::size_t values = 0;
};

struct FleetSums {
  // The exposures of the units that are summed, in order. Where each unit has exposures of its own,
  // sums over all of the campaign's would be mostly zeros.
  std::vector<std::size_t> exposures;
  std::vector<LookSums> looks;
};

/// Sums of no unit yet, with the exposures of the chunk's units.
FleetSums EmptySums(const PassPlan& plan, const UnitChunk& chunk);

/// Pre: the exposures of `from` are among those of `to`.
void AddSums(const PassPlan& plan, const FleetSums& from, FleetSums* to);

}  // namespace focalfleet::sim
