// Noise and weights of a fit (fit.h, whiten.h). Variances come first, by maximum likelihood with
// the density of Student's t, in which outliers cost a logarithm. Factors of units and of exposures
// follow, by residuals in the spread that the fit leaves each of them.
// Source: Cook and Weisberg, Residuals and Influence in Regression, 1982, chapter 2.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/fit.h"
#include "sim/campaigns/diagnosis/model/noise_cost.h"

namespace focalfleet::sim {
namespace {

constexpr double kMedianSquare = 2 * std::numbers::ln2;  // of a whitened 2-D normal residual

// Rest errors are expected to be as large as the camera's noise, give or take this factor. Half and
// twice of it change nothing above some 100 rows: a row says far more than the prior.
constexpr double kExpectedWithin = 10;

double Lever_um(const std::vector<NoiseUnit>& sample, int axis) {
  double most = 0;
  for (const NoiseUnit& unit : sample)
    for (const NoiseMove& move : unit.moves)
      most = std::max(most, std::hypot(move.turn_um[2 * axis], move.turn_um[2 * axis + 1]));
  return most;
}

// Coordinate search in the logarithms of the spreads, and in the shares carried.
class NoiseSearch {
 public:
  NoiseSearch(const std::vector<NoiseUnit>& sample, const Noise& begin)
      : sample_(sample), best_(begin) {
    for (int axis = 0; axis < 2; ++axis) lever_um_[axis] = std::max(Lever_um(sample, axis), 1e-6);
    cost_ = Cost(begin);
  }

  void Search(double widest, bool with_carry) {
    for (double factor = widest; factor > kFine; factor = std::sqrt(factor)) {
      Scale(factor);
      for (const double f : {factor, 1 / factor}) {
        for (int axis = 0; axis < 2; ++axis) {
          Attempt([&](Noise* n) { n->rest_deg[axis] *= f; });
          Attempt([&](Noise* n) { n->angle_deg[axis] *= f; });
        }
        Attempt([&](Noise* n) { n->rest_um *= f; });
      }
      if (!with_carry) continue;
      const double wide = 0.5 * (factor - 1);
      for (int part = 0; part < 3; ++part)
        for (const double d : {wide, -wide})
          Attempt([&](Noise* n) { n->carry[part] = std::clamp(n->carry[part] + d, 0.0, 1.0); });
    }
  }
  // Tries steps that changes by a factor do not reach.
  void Leaps() {
    for (int axis = 0; axis < 2; ++axis) {
      const auto same = [&](double share) { return share * best_.place_um / lever_um_[axis]; };
      Attempt([&](Noise* n) { std::swap(n->rest_deg[axis], n->angle_deg[axis]); });
      Attempt([&](Noise* n) {
        const double of_axis_um = n->rest_deg[axis] * lever_um_[axis];
        n->rest_deg[axis] = n->rest_um / lever_um_[axis];
        n->rest_um = of_axis_um;
      });
      Attempt([&](Noise* n) { n->carry[axis] = 0; });
      if (best_.rest_deg[axis] < same(0.2))
        for (const double share : {0.3, 1.0})
          Attempt([&](Noise* n) { n->rest_deg[axis] = same(share); });
    }
    Attempt([&](Noise* n) { n->carry[2] = 0; });
    if (best_.rest_um < 0.2 * best_.place_um)
      for (const double share : {0.3, 1.0})
        Attempt([&](Noise* n) { n->rest_um = share * n->place_um; });
  }
  [[nodiscard]] const Noise& best() const { return best_; }
  [[nodiscard]] double cost() const { return cost_; }

 private:
  static constexpr double kFine = 1.015;
  [[nodiscard]] double Cost(const Noise& noise) {
    double cost = 0;
    for (const NoiseUnit& unit : sample_) cost += CostOf(unit, noise, &scratch_);
    for (int axis = 0; axis < 2; ++axis)
      cost += PriorCost(noise.rest_deg[axis] * lever_um_[axis], noise) +
              PriorCost(noise.angle_deg[axis] * lever_um_[axis], noise);
    return cost + PriorCost(noise.rest_um, noise);
  }
  // A normal prior of the logarithm. A spread below a hundredth of the camera's noise is none.
  static double PriorCost(double spread_um, const Noise& noise) {
    const double least = noise.place_um / (kExpectedWithin * kExpectedWithin);
    const double decades =
        std::log(std::max(spread_um, least) / noise.place_um) / std::log(kExpectedWithin);
    return decades * decades / 2;
  }
  template <class Change>
  void Attempt(const Change& change) {
    Noise next = best_;
    change(&next);
    const double cost = Cost(next);
    if (cost < cost_) cost_ = cost, best_ = next;
  }
  void Scale(double factor) {
    for (const double f : {factor, 1 / factor}) Attempt([&](Noise* n) { n->place_um *= f; });
  }

  const std::vector<NoiseUnit>& sample_;
  double lever_um_[2] = {1, 1};
  Noise best_;
  double cost_ = 0;
  NoiseScratch scratch_;
};

// A search without a previous result. Errors that are held and errors that are not look alike from
// far off, so that the search begins at either.
Noise SearchAnew(const std::vector<NoiseUnit>& sample, double typical_um, Noise noise) {
  noise.place_um = typical_um;
  std::fill_n(noise.carry, 3, 0.0);
  double least = 0;
  Noise best = noise;
  for (const bool held : {true, false}) {
    Noise begin = noise;
    begin.rest_um = (held ? 0.5 : 0.01) * typical_um;
    for (int axis = 0; axis < 2; ++axis) {
      const double angle_deg = typical_um / std::max(Lever_um(sample, axis), 1e-6);
      begin.rest_deg[axis] = (held ? 0.5 : 0.01) * angle_deg;
      begin.angle_deg[axis] = (held ? 0.01 : 0.5) * angle_deg;
    }
    NoiseSearch search(sample, begin);
    search.Search(4, false);
    if (held || search.cost() < least) least = search.cost(), best = search.best();
  }
  NoiseSearch search(sample, best);
  search.Leaps();
  search.Search(2, noise.may_carry);
  return search.best();
}

void FitVariances(const std::vector<NoiseUnit>& sample, Noise* noise) {
  std::vector<double> squares;
  for (const NoiseUnit& unit : sample)
    for (const NoiseMove& move : unit.moves)
      if (move.seen)
        squares.push_back((move.x_um * move.x_um + move.y_um * move.y_um) /
                          (unit.factor * unit.factor));
  if (squares.empty()) return;
  const double typical = std::max(std::sqrt(MiddleOf(squares) / kMedianSquare), noise->least_um);
  // A previous result that is near makes the search short. Without one, or with one far away, the
  // search is anew.
  const bool near =
      noise->fitted && typical < 2 * noise->typical_um && typical > 0.5 * noise->typical_um;
  if (near) {
    NoiseSearch search(sample, *noise);
    search.Leaps();
    search.Search(1.2, noise->may_carry);
    *noise = search.best();
  } else {
    *noise = SearchAnew(sample, typical, *noise);
  }
  noise->fitted = true;
  noise->typical_um = typical;
  noise->place_um = std::max(noise->place_um, noise->least_um);
}

// The share of its noise that is left in each used row beside the fit of the unit's own unknowns,
// 0..1: one less the row's leverage.
std::vector<double> SharesLeft(const Fit& fit, std::size_t unit, const WhiteUnit& white) {
  // A row of which less is left says little of the noise. Half and twice of it change no verdict
  // and no candidate of 61 campaigns of three generators.
  constexpr double kLeast = 0.1;
  Eigen::MatrixXd own = OwnDisplacements(fit, unit, white);
  std::vector<double> left(white.moves.size(), kLeast);
  if (own.rows() <= own.cols()) return left;
  for (Eigen::Index c = 0; c < own.cols(); ++c) white.Apply(own.col(c).data());
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(own);
  const Eigen::MatrixXd plane =
      solver.householderQ() * Eigen::MatrixXd::Identity(own.rows(), solver.rank());
  for (std::size_t k = 0; k < left.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(2 * k);
    left[k] = std::max(1 - plane.middleRows<2>(at).squaredNorm() / 2, kLeast);
  }
  return left;
}

// Errors that all units may have alike in one exposure: of theta, of phi, in x, in y. They are an
// effect, not noise.
constexpr Eigen::Index kAlikeErrors = 4;

// A used row: its whitened place, and what each error alike makes of it.
struct WhiteRow {
  std::size_t exposure = 0;
  double camera_share = 1;  // of the row's variance: an exposure's factor is of this part alone
  Eigen::Vector2d y;
  Eigen::Matrix<double, 2, kAlikeErrors> alike;
};
struct UnitLengths {
  std::vector<double> square;  // of the used rows, for what the fit has left of them
  std::vector<WhiteRow> rows;  // the same, divided by the unit's factor
};

Eigen::Matrix<double, 2, kAlikeErrors> AlikeOf(const WhiteUnit& white, std::size_t k) {
  const double* t = &white.turn_um[4 * k];
  const double* w = white.filter[k].w;
  Eigen::Matrix2d root;
  root << w[0], w[1], w[1], w[2];
  Eigen::Matrix<double, 2, kAlikeErrors> errors;
  errors << t[0], t[2], 1, 0, t[1], t[3], 0, 1;
  return root * errors;
}

// The share of the camera's own noise in the variance of a used row.
double CameraShare(const Fit& fit, std::size_t unit, const WhiteUnit& white, std::size_t k,
                   double weight) {
  const std::size_t row = white.track.first_row + white.moves[k];
  const double factor = fit.noise.exposure_factor.empty()
                            ? 1
                            : fit.noise.exposure_factor[fit.facts->exposures.of_row[row]];
  const double own_um = fit.noise.unit_factor[unit] * fit.noise.place_um * factor;
  const double* w = white.filter[k].w;
  const double inverse = (w[0] * w[0] + 2 * w[1] * w[1] + w[2] * w[2]) / 2 / weight;
  return std::min(own_um * own_um * inverse, 1.0);
}

// Squared lengths of an exposure's rows without what they have alike, scaled for what the fit of
// that takes from them.
std::vector<double> LengthsOf(const std::vector<const WhiteRow*>& rows) {
  constexpr double kFar = 3;  // whitened length from which a row counts less
  Eigen::Matrix<double, kAlikeErrors, kAlikeErrors> normal =
      Eigen::Matrix<double, kAlikeErrors, kAlikeErrors>::Zero();
  Eigen::Matrix<double, kAlikeErrors, 1> right = Eigen::Matrix<double, kAlikeErrors, 1>::Zero();
  for (const WhiteRow* row : rows) {
    const double weight = std::min(1.0, kFar / std::max(row->y.norm(), 1e-6));
    normal += weight * row->alike.transpose() * row->alike;
    right += weight * row->alike.transpose() * row->y;
  }
  const Eigen::Matrix<double, kAlikeErrors, 1> alike =
      normal.completeOrthogonalDecomposition().solve(right);
  const double n = 2 * static_cast<double>(rows.size());
  const double left = n / std::max(n - static_cast<double>(kAlikeErrors), 1.0);
  std::vector<double> squares;
  for (const WhiteRow* row : rows)
    squares.push_back((row->y - row->alike * alike).squaredNorm() * left);
  return squares;
}

// Air blurs by 8 um at worst, and cameras measure to 1 um. An exposure that is off by more is one
// of false spots, whose rows are outliers. Half and twice of it: the same.
constexpr double kExposureFactorMost = 10;

// Factors are about 1. The common part of the units' factors, which know what the fits of the units
// have absorbed, is the fleet's noise; exposures have none in common. A unit or an exposure without
// any residual has a factor, too: the least that numbers allow. Half or twice of it decides
// nothing, as a place's noise has a floor of its own (rest_filter.h).
void Normalise(Noise* noise) {
  constexpr double kFactorLeast = 0.01;
  for (std::vector<double>* factors : {&noise->unit_factor, &noise->exposure_factor})
    for (double& factor : *factors) factor = std::max(factor, kFactorLeast);
  if (!noise->exposure_factor.empty()) {
    const double usual = MiddleOf(noise->exposure_factor);
    for (double& factor : noise->exposure_factor)
      factor = std::clamp(factor / usual, 1 / kExposureFactorMost, kExposureFactorMost);
  }
  const double usual = MiddleOf(noise->unit_factor);
  for (double& factor : noise->unit_factor) factor /= usual;
  noise->place_um = std::max(noise->place_um * usual, noise->least_um);
  for (int axis = 0; axis < 2; ++axis)
    noise->rest_deg[axis] *= usual, noise->angle_deg[axis] *= usual;
  noise->rest_um *= usual;
}

// An estimate of the logarithm of a variance, and the variance of its error.
struct LogVariance {
  double value = 0;
  double error2 = 0;  // 0: no data
};

// The relative variance of the median of n squared lengths, times n: they have an exponential law,
// whose median is 2 ln 2 and whose density there is a quarter.
constexpr double kMedianError = 4 / (kMedianSquare * kMedianSquare);

// Draws estimates to their median by what they scatter beyond their errors (empirical Bayes). An
// estimate that is far beyond both is another kind, and stays.
// Source: Efron, Large-Scale Inference, chapter 1.
std::vector<double> DrawTogether(const std::vector<LogVariance>& estimates) {
  constexpr double kFar = 3;  // in standard deviations
  std::vector<double> values, errors2, deviations;
  for (const LogVariance& one : estimates)
    if (one.error2 > 0) values.push_back(one.value), errors2.push_back(one.error2);
  if (values.empty()) return std::vector<double>(estimates.size(), 0);
  const double middle = MiddleOf(values);
  for (const double value : values) deviations.push_back(std::abs(value - middle));
  const double scatter = kSigmaOfMedian * MiddleOf(std::move(deviations));
  const double true2 = std::max(scatter * scatter - MiddleOf(std::move(errors2)), 0.0);
  std::vector<double> drawn;
  for (const LogVariance& one : estimates) {
    const double off = one.error2 > 0 ? one.value - middle : 0;
    const bool is_far = off * off > kFar * kFar * (true2 + one.error2);
    drawn.push_back(middle + (is_far ? 1 : true2 / (true2 + one.error2 + 1e-12)) * off);
  }
  return drawn;
}

// The variance of the camera's noise in an exposure, by its present factor.
LogVariance ExposureVariance(const std::vector<const WhiteRow*>& rows, double factor) {
  // A smaller share of the variance is not resolved in one step. Half of it,
  // it and twice of it: 5, 4 and 4 of 40 campaigns without an effect (60 units, 12 moves) are given
  // a cause.
  constexpr double kLeast = 0.05;
  constexpr std::size_t kRowsMin = 6;  // fewer say next to nothing beside what they have alike
  if (rows.size() < kRowsMin) return {};
  const auto n = static_cast<double>(rows.size());
  double share = 0;
  for (const WhiteRow* row : rows) share += row->camera_share / n;
  // Squares grow by the camera's share of them. Their median is known to a part of itself, which
  // may be many times of a small variance of the camera.
  const double whole = MiddleOf(LengthsOf(rows)) / kMedianSquare;
  const double of_camera = std::max(1 + (whole - 1) / share, kLeast);
  const double error = whole / (share * of_camera);
  return {2 * std::log(factor) + std::log(of_camera), kMedianError / n * error * error};
}

void FitFactors(Fit* fit) {
  constexpr std::size_t kUnitsMin = 6;  // that an exposure's factor is estimated from
  // Rows that a unit's factor is estimated from: with five, ten coordinates have four degrees of
  // freedom beside the geometry's six unknowns. Half and twice of it: not measured on units that
  // have so few.
  constexpr double kRowsMin = 5;
  const std::size_t units = fit->model.units.size();
  const bool with_exposures = units >= kUnitsMin;
  std::vector<UnitLengths> lengths(units);
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      std::vector<double> weights;
      const WhiteUnit white = WhitenAnew(*fit, unit, &weights);
      const std::vector<double> left = SharesLeft(*fit, unit, white);
      for (std::size_t k = 0; k < white.moves.size(); ++k) {
        const auto at = static_cast<Eigen::Index>(2 * k);
        const double size = std::sqrt(weights[k] * left[k]);
        lengths[unit].square.push_back(white.y.segment<2>(at).squaredNorm() / (size * size));
        if (with_exposures)
          lengths[unit].rows.push_back(
              {fit->facts->exposures.of_row[white.track.first_row + white.moves[k]],
               CameraShare(*fit, unit, white, k, weights[k]), white.y.segment<2>(at) / size,
               AlikeOf(white, k) / size});
      }
    }
  });
  std::vector<LogVariance> of_unit(units);
  for (std::size_t unit = 0; unit < units; ++unit) {
    const auto rows = static_cast<double>(lengths[unit].square.size());
    if (rows < kRowsMin) continue;
    const double own = MiddleOf(lengths[unit].square) / kMedianSquare;
    of_unit[unit] = {2 * std::log(fit->noise.unit_factor[unit]) + std::log(std::max(own, 1e-6)),
                     kMedianError / rows};
  }
  const std::vector<double> unit_variance = DrawTogether(of_unit);
  std::vector<std::vector<const WhiteRow*>> of_exposure(fit->facts->exposures.size());
  for (std::size_t unit = 0; unit < units; ++unit) {
    const double factor = std::exp(unit_variance[unit] / 2);
    // Exposures get what is left after the units' factors.
    const double change = factor / fit->noise.unit_factor[unit];
    for (WhiteRow& row : lengths[unit].rows) {
      row.y /= change, row.alike /= change;
      of_exposure[row.exposure].push_back(&row);
    }
    fit->noise.unit_factor[unit] = factor;
  }
  if (!with_exposures) return Normalise(&fit->noise);
  std::vector<double>& factor = fit->noise.exposure_factor;
  factor.resize(of_exposure.size(), 1);
  std::vector<LogVariance> variances;
  for (std::size_t e = 0; e < of_exposure.size(); ++e)
    variances.push_back(ExposureVariance(of_exposure[e], factor[e]));
  const std::vector<double> drawn = DrawTogether(variances);
  for (std::size_t e = 0; e < factor.size(); ++e) factor[e] = std::exp(drawn[e] / 2);
  Normalise(&fit->noise);
}

}  // namespace

void UpdateNoise(Fit* fit) {
  Noise& noise = fit->noise;
  if (noise.unit_factor.empty()) noise.unit_factor.assign(fit->model.units.size(), 1);
  const std::vector<NoiseUnit> sample = SampleForNoise(*fit);
  FitVariances(sample, &noise);
  FitFactors(fit);
}

void UpdateWeights(Fit* fit) {
  fit->weight.assign(fit->facts->campaign->rows(), 0);
  const std::vector<UnitChunk> chunks = ChunksOf(fit->model.units.size());
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    std::vector<double> weights;
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const WhiteUnit white = WhitenAnew(*fit, unit, &weights);
      for (std::size_t k = 0; k < white.moves.size(); ++k)
        fit->weight[white.track.first_row + white.moves[k]] = weights[k];
    }
  });
}

}  // namespace focalfleet::sim
