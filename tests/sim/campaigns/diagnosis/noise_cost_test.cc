// The cost of a noise, with unknowns side by side, is that of columns one by one.
#include "sim/campaigns/diagnosis/model/noise_cost.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/rest_filter.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

// Column c of a unit's, out of its lanes.
Eigen::VectorXd ColumnOf(const NoiseUnit& unit, std::size_t c) {
  const std::size_t rows = unit.turn_um.size() / 2;
  Eigen::VectorXd column(static_cast<Eigen::Index>(rows));
  for (std::size_t r = 0; r < rows; ++r)
    column[static_cast<Eigen::Index>(r)] = unit.columns[c / kLanes * rows + r].at[c % kLanes];
  return column;
}

// The definition: the density row by row, and what a fit of the unknowns takes from it.
double PlainCost(const NoiseUnit& unit, const Noise& noise) {
  RestFilter filter(noise, unit.factor);
  std::vector<RowFilter> rows;
  double cost = 0;
  for (const NoiseMove& move : unit.moves) {
    filter.Move(move.restarts, move.theta_moves, move.phi_moves);
    if (!move.seen) continue;
    filter.See(move.turn_um, move.exposure_factor);
    const double square = filter.SquareLength(move.x_um, move.y_um);
    cost += std::log(filter.determinant()) / 2 + MinusLogDensity(square);
    rows.push_back(filter.Take(std::min(1.0, (kPlaceFreedom + 2) / (kPlaceFreedom + square))));
    double white[2];
    filter.Whiten(rows.back(), move.turn_um, move.x_um, move.y_um, white);
  }
  const auto n = static_cast<Eigen::Index>(unit.unknowns);
  Eigen::MatrixXd all(static_cast<Eigen::Index>(2 * rows.size()), n + 1);
  for (Eigen::Index c = 0; c <= n; ++c) {
    all.col(c) = ColumnOf(unit, static_cast<std::size_t>(c));
    ApplyFilter(rows, unit.turn_um, all.col(c).data());
  }
  const Eigen::MatrixXd own = all.leftCols(n);
  Eigen::MatrixXd normal = own.transpose() * own;
  normal.diagonal().array() += 1e-12;
  const Eigen::VectorXd right = own.transpose() * all.col(n);
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  cost -= right.dot(solver.solve(right)) / 2;
  for (Eigen::Index c = 0; c < n; ++c) cost += std::log(std::max(solver.vectorD()[c], 1e-12)) / 2;
  return cost;
}

// Zeros of homings are unknowns beyond the eight of one block.
TEST(NoiseCost, IsThatOfColumnsOneByOne) {
  const Campaign campaign = test::Planted({}, {.units = 6,
                                               .moves = 60,
                                               .seed = 4,
                                               .outlier_share = 0.02,
                                               .lost_share = 0.05,
                                               .homing_share = 0.1});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = test::StaticFit(facts);
  FreeHomings(&fit);
  NoiseScratch scratch;
  Noise noise = fit.noise;
  std::size_t most = 0;
  for (const NoiseUnit& unit : SampleForNoise(fit))
    for (const double factor : {1.0, 3.0, 1e-3}) {
      noise.place_um = factor * fit.noise.place_um;
      noise.carry[kTheta] = factor < 1 ? 0.5 : 0;
      const double plain = PlainCost(unit, noise);
      // All zeros together are the geometry's: of that direction only rounding is left.
      EXPECT_NEAR(CostOf(unit, noise, &scratch), plain, 1e-4);
      most = std::max(most, unit.unknowns);
    }
  EXPECT_GT(most, 2 * kLanes);
}

}  // namespace
}  // namespace focalfleet::sim
