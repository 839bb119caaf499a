#include "sim/campaigns/diagnosis/model/noise_cost.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/rest_filter.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// Puts a column into its lane.
void PutColumn(const double* column, std::size_t rows, std::size_t at, std::vector<Lanes>* lanes) {
  Lanes* block = lanes->data() + at / kLanes * rows;
  for (std::size_t r = 0; r < rows; ++r) block[r].at[at % kLanes] = column[r];
}

NoiseUnit SampleOf(const Fit& fit, std::size_t unit) {
  NoiseUnit one{.factor = fit.noise.unit_factor[unit]};
  std::vector<double> weights;
  const WhiteUnit white = WhitenAnew(fit, unit, &weights);
  const UnitTrack& track = white.track;
  one.moves.resize(track.moves);
  for (std::size_t i = 0; i < track.moves; ++i)
    one.moves[i].restarts = track.restarts[i] != 0,
    one.moves[i].theta_moves = track.step_deg[0][i] != 0,
    one.moves[i].phi_moves = track.step_deg[1][i] != 0;
  std::vector<double> residuals;
  for (std::size_t k = 0; k < white.moves.size(); ++k) {
    const std::size_t row = track.first_row + white.moves[k];
    NoiseMove& move = one.moves[white.moves[k]];
    move.seen = true;
    move.x_um = fit.x_um[row], move.y_um = fit.y_um[row];
    residuals.insert(residuals.end(), {move.x_um, move.y_um});
    std::copy_n(&white.turn_um[4 * k], 4, move.turn_um);
    if (!fit.noise.exposure_factor.empty())
      move.exposure_factor = fit.noise.exposure_factor[fit.facts->exposures.of_row[row]];
  }
  one.turn_um = white.turn_um;
  const MatrixXd own = OwnDisplacements(fit, unit, white);
  one.unknowns = static_cast<std::size_t>(own.cols());
  one.columns.resize((one.unknowns / kLanes + 1) * residuals.size());
  for (std::size_t c = 0; c < one.unknowns; ++c)
    PutColumn(own.col(static_cast<Index>(c)).data(), residuals.size(), c, &one.columns);
  PutColumn(residuals.data(), residuals.size(), one.unknowns, &one.columns);
  return one;
}

// The logarithm of a product of many numbers, taken of some of them at a time: it costs as much as
// a row's other arithmetic.
class LogOfProduct {
 public:
  void Multiply(double factor) {
    constexpr double kMost = 1e100;  // squares of it and of one over it are numbers, too
    product_ *= factor;
    if (product_ > kMost || product_ < 1 / kMost) log_ += std::log(product_), product_ = 1;
  }
  [[nodiscard]] double log() const { return log_ + std::log(product_); }

 private:
  double product_ = 1, log_ = 0;
};

// All products of the whitened columns with each other, also those of the residuals.
void TakeNormal(const NoiseUnit& unit, NoiseScratch* scratch) {
  const std::size_t rows = unit.turn_um.size() / 2, blocks = unit.unknowns / kLanes + 1;
  const auto size = static_cast<Index>(blocks * kLanes);
  scratch->white.resize(unit.columns.size());
  scratch->normal.resize(size, size);
  for (std::size_t block = 0; block < blocks; ++block)
    WhitenLanes(scratch->rows, unit.turn_um.data(), unit.columns.data() + block * rows,
                scratch->white.data() + block * rows);
  for (std::size_t a = 0; a < blocks; ++a)
    for (std::size_t b = a; b < blocks; ++b) {
      const LaneProducts products =
          MultiplyBlocks(scratch->white.data() + a * rows, scratch->white.data() + b * rows, rows);
      for (std::size_t i = 0; i < kLanes; ++i)
        for (std::size_t j = 0; j < kLanes; ++j) {
          const auto row = static_cast<Index>(a * kLanes + i);
          const auto column = static_cast<Index>(b * kLanes + j);
          scratch->normal(row, column) = scratch->normal(column, row) = products[i].at[j];
        }
    }
}

}  // namespace

MatrixXd OwnDisplacements(const Fit& fit, std::size_t unit, const WhiteUnit& white) {
  MatrixXd own = GeometryDisplacements(white);
  PoseErrors errors;
  for (const ModelTerm& term : fit.model.terms) {
    if (term.sharing != Sharing::kUnit || term.group_of_unit[unit] == kNoGroup) continue;
    for (std::size_t c = 0; c < term.form.columns; ++c) {
      ApplyColumn(white.track, term.form, c, 1, &errors);
      own.conservativeResize(Eigen::NoChange, own.cols() + 1);
      Displacement(white, errors, own.col(own.cols() - 1).data());
    }
  }
  for (const Homing& homing : FreeHomingsOf(fit.model, white.track)) {
    ApplyHoming(white.track, homing, &errors);
    own.conservativeResize(Eigen::NoChange, own.cols() + 1);
    Displacement(white, errors, own.col(own.cols() - 1).data());
  }
  // Columns are scaled to a common size: only the plane that they span matters.
  for (Index c = 0; c < own.cols(); ++c)
    if (const double length = own.col(c).norm(); length > 0) own.col(c) /= length;
  return own;
}

std::vector<NoiseUnit> SampleForNoise(const Fit& fit) {
  // A spread is then known to a hundredth. With half of it five of 30 campaigns of 2000 to 7000
  // rows get another verdict or other candidates, with twice as much two.
  constexpr std::size_t kRowsMost = 4000;
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t stride =
      std::max<std::size_t>(1, (campaign.rows() + kRowsMost - 1) / kRowsMost);
  std::vector<NoiseUnit> sample;
  for (std::size_t unit = 0; unit < campaign.units.size(); unit += stride)
    sample.push_back(SampleOf(fit, unit));
  return sample;
}

double CostOf(const NoiseUnit& unit, const Noise& noise, NoiseScratch* scratch) {
  constexpr double kLoose = 1e-12;  // of an unknown that the rows do not show
  LogOfProduct determinants, far;
  RestFilter filter(noise, unit.factor);
  scratch->rows.clear();
  for (const NoiseMove& move : unit.moves) {
    filter.Move(move.restarts, move.theta_moves, move.phi_moves);
    if (!move.seen) continue;
    filter.See(move.turn_um, move.exposure_factor);
    const double square = filter.SquareLength(move.x_um, move.y_um);
    determinants.Multiply(filter.determinant());
    far.Multiply(1 + square / kPlaceFreedom);
    scratch->rows.push_back(
        filter.Take(std::min(1.0, (kPlaceFreedom + 2) / (kPlaceFreedom + square))));
    double white[2];
    filter.Whiten(scratch->rows.back(), move.turn_um, move.x_um, move.y_um, white);
  }
  double cost = determinants.log() / 2 + (kPlaceFreedom + 2) / 2 * far.log();
  TakeNormal(unit, scratch);
  const auto n = static_cast<Index>(unit.unknowns);
  scratch->normal.topLeftCorner(n, n).diagonal().array() += kLoose;
  const VectorXd right = scratch->normal.col(n).head(n);
  const Eigen::LDLT<MatrixXd> solver(scratch->normal.topLeftCorner(n, n));
  cost -= right.dot(solver.solve(right)) / 2;
  for (Index c = 0; c < n; ++c) cost += std::log(std::max(solver.vectorD()[c], kLoose)) / 2;
  return cost;
}

}  // namespace focalfleet::sim
