// Noise and weights of a fit (fit.h, whiten.h). Variances come first, by maximum likelihood with
// the density of Student's t, in which outliers cost a logarithm. Factors of units and of exposures
// follow.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/campaigns/diagnosis/chances.h"
#include "sim/campaigns/diagnosis/fit.h"
#include "sim/campaigns/diagnosis/rest_filter.h"

namespace focalfleet::sim {
namespace {

constexpr double kMedianSquare = 2 * std::numbers::ln2;  // of a whitened 2-D normal residual
constexpr std::size_t kVarianceRowsMax = 4000;           // rows that the variances come from
constexpr std::size_t kVarianceRowsMin = 200;            // fewer: one variance only

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
  // Effects of the unit's own unknowns (geometry, own amplitudes). Shape: (2 seen, unknowns).
  Eigen::MatrixXd own;
};

Eigen::MatrixXd OwnDisplacements(const Fit& fit, std::size_t unit, const WhiteUnit& white) {
  Eigen::MatrixXd own = GeometryDisplacements(white);
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
  for (Eigen::Index c = 0; c < own.cols(); ++c)
    if (const double length = own.col(c).norm(); length > 0) own.col(c) /= length;
  return own;
}

// Whole units, evenly from the fleet.
std::vector<NoiseUnit> Sample(const Fit& fit) {
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t units = campaign.units.size();
  const std::size_t stride =
      std::max<std::size_t>(1, (campaign.rows() + kVarianceRowsMax - 1) / kVarianceRowsMax);
  std::vector<NoiseUnit> sample;
  for (std::size_t unit = 0; unit < units; unit += stride) {
    NoiseUnit one{fit.noise.unit_factor[unit], {}, {}, {}};
    std::vector<double> weights;
    const WhiteUnit white = WhitenAnew(fit, unit, &weights);
    const UnitTrack& track = white.track;
    one.moves.resize(track.moves);
    for (std::size_t i = 0; i < track.moves; ++i)
      one.moves[i].restarts = track.restarts[i] != 0,
      one.moves[i].theta_moves = track.step_deg[0][i] != 0,
      one.moves[i].phi_moves = track.step_deg[1][i] != 0;
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t row = track.first_row + white.moves[k];
      NoiseMove& move = one.moves[white.moves[k]];
      move.seen = true;
      move.x_um = fit.x_um[row], move.y_um = fit.y_um[row];
      std::copy_n(&white.turn_um[4 * k], 4, move.turn_um);
      if (!fit.noise.exposure_factor.empty())
        move.exposure_factor = fit.noise.exposure_factor[fit.facts->exposures.of_row[row]];
    }
    one.turn_um = white.turn_um;
    one.own = OwnDisplacements(fit, unit, white);
    sample.push_back(std::move(one));
  }
  return sample;
}

// The cost of a unit is the density of each place given those before it, and the part that the
// unit's own unknowns have absorbed. The likelihood is restricted, with the unknowns to second
// order about the residuals.
// Source: Patterson and Thompson, Biometrika 58 (1971) 545.
double CostOf(const NoiseUnit& unit, const Noise& noise) {
  constexpr double kLoose = 1e-12;  // of an unknown that the rows do not show
  double cost = 0;
  RestFilter filter(noise, unit.factor);
  std::vector<RowFilter> rows;
  Eigen::VectorXd y(unit.own.rows());
  for (const NoiseMove& move : unit.moves) {
    filter.Move(move.restarts, move.theta_moves, move.phi_moves);
    if (!move.seen) continue;
    filter.See(move.turn_um, move.exposure_factor);
    const double square = filter.SquareLength(move.x_um, move.y_um);
    cost += std::log(filter.determinant()) / 2 + MinusLogDensity(square);
    rows.push_back(filter.Take(std::min(1.0, (kPlaceFreedom + 2) / (kPlaceFreedom + square))));
    filter.Whiten(rows.back(), move.turn_um, move.x_um, move.y_um,
                  &y[static_cast<Eigen::Index>(2 * rows.size() - 2)]);
  }
  Eigen::MatrixXd own = unit.own;
  for (Eigen::Index c = 0; c < own.cols(); ++c) ApplyFilter(rows, unit.turn_um, own.col(c).data());
  Eigen::MatrixXd normal = own.transpose() * own;
  normal.diagonal().array() += kLoose;
  const Eigen::VectorXd right = own.transpose() * y;
  const Eigen::LDLT<Eigen::MatrixXd> solver(normal);
  cost -= right.dot(solver.solve(right)) / 2;
  for (Eigen::Index c = 0; c < own.cols(); ++c)
    cost += std::log(std::max(solver.vectorD()[c], kLoose)) / 2;
  return cost;
}

double Cost(const std::vector<NoiseUnit>& sample, const Noise& noise) {
  double cost = 0;
  for (const NoiseUnit& unit : sample) cost += CostOf(unit, noise);
  return cost;
}

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
      : sample_(sample), best_(begin), cost_(Cost(sample, begin)) {}

  void Place(double widest) {
    for (double factor = widest; factor > kFine; factor = std::sqrt(factor)) Scale(factor);
  }
  void Axes(double widest, bool with_carry) {
    for (double factor = widest; factor > kFine; factor = std::sqrt(factor)) {
      Scale(factor);
      for (int axis = 0; axis < 2; ++axis) {
        for (const double f : {factor, 1 / factor}) {
          Attempt([&](Noise* n) { n->rest_deg[axis] *= f; });
          Attempt([&](Noise* n) { n->angle_deg[axis] *= f; });
        }
        const double wide = with_carry ? 0.5 * (factor - 1) : 0;
        for (const double d : {wide, -wide})
          if (d != 0)
            Attempt([&](Noise* n) { n->carry[axis] = std::clamp(n->carry[axis] + d, 0.0, 1.0); });
      }
    }
  }
  // Tries steps that changes by a factor do not reach.
  void Leaps() {
    for (int axis = 0; axis < 2; ++axis) {
      const double lever = std::max(Lever_um(sample_, axis), 1e-6);
      const auto same = [&](double value) { return value * best_.place_um / lever; };
      Attempt([&](Noise* n) { std::swap(n->rest_deg[axis], n->angle_deg[axis]); });
      Attempt([&](Noise* n) { n->carry[axis] = 0; });
      if (best_.rest_deg[axis] < same(0.2))
        for (const double share : {0.3, 1.0})
          Attempt([&](Noise* n) { n->rest_deg[axis] = same(share); });
    }
  }
  [[nodiscard]] const Noise& best() const { return best_; }
  [[nodiscard]] double cost() const { return cost_; }

 private:
  static constexpr double kFine = 1.015;
  template <class Change>
  void Attempt(const Change& change) {
    Noise next = best_;
    change(&next);
    const double cost = Cost(sample_, next);
    if (cost < cost_) cost_ = cost, best_ = next;
  }
  void Scale(double factor) {
    for (const double f : {factor, 1 / factor}) Attempt([&](Noise* n) { n->place_um *= f; });
  }

  const std::vector<NoiseUnit>& sample_;
  Noise best_;
  double cost_;
};

// A search without a previous result. Errors that are held and errors that are not look alike from
// far off, so that the search begins at either.
Noise SearchAnew(const std::vector<NoiseUnit>& sample, bool with_axes, double typical_um,
                 Noise noise) {
  noise.place_um = typical_um;
  for (int axis = 0; axis < 2; ++axis)
    noise.rest_deg[axis] = noise.angle_deg[axis] = noise.carry[axis] = 0;
  if (!with_axes) {
    NoiseSearch search(sample, noise);
    search.Place(8);
    return search.best();
  }
  double least = 0;
  Noise best = noise;
  for (const bool held : {true, false}) {
    Noise begin = noise;
    for (int axis = 0; axis < 2; ++axis) {
      const double angle_deg = typical_um / std::max(Lever_um(sample, axis), 1e-6);
      begin.rest_deg[axis] = (held ? 0.5 : 0.01) * angle_deg;
      begin.angle_deg[axis] = (held ? 0.01 : 0.5) * angle_deg;
    }
    NoiseSearch search(sample, begin);
    search.Axes(4, false);
    if (held || search.cost() < least) least = search.cost(), best = search.best();
  }
  NoiseSearch search(sample, best);
  search.Leaps();
  search.Axes(2, noise.may_carry);
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
  const bool with_axes = squares.size() >= kVarianceRowsMin;
  const double typical = std::max(std::sqrt(Median(squares) / kMedianSquare), noise->least_um);
  // A previous result that is near makes the search short. Without one, or with one far away, the
  // search is anew.
  const bool near =
      noise->fitted && typical < 2 * noise->typical_um && typical > 0.5 * noise->typical_um;
  if (near) {
    NoiseSearch search(sample, *noise);
    if (with_axes) {
      search.Leaps();
      search.Axes(1.2, noise->may_carry);
    } else {
      search.Place(1.2);
    }
    *noise = search.best();
  } else {
    *noise = SearchAnew(sample, with_axes, typical, *noise);
  }
  noise->fitted = true;
  noise->typical_um = typical;
  noise->place_um = std::max(noise->place_um, noise->least_um);
}

std::size_t OwnColumns(const Fit& fit, std::size_t unit) {
  std::size_t columns = kStaticColumns;
  for (const ModelTerm& term : fit.model.terms)
    if (term.sharing == Sharing::kUnit && term.group_of_unit[unit] != kNoGroup)
      columns += term.form.columns;
  return columns;
}

// A factor from the median of n whitened squares, drawn to the usual one.
double Shrunk(double own, double n, double usual) {
  constexpr double kShrink = 10;
  return std::sqrt(std::max((n * own + kShrink * usual) / (n + kShrink), 1e-6));
}

struct UnitLengths {
  std::vector<double> square;  // of the used rows
  std::vector<std::size_t> exposure;
};

// Factors are about 1; their common part is the fleet's noise. A unit or an exposure without any
// residual has a factor, too: the least that numbers allow. Half or twice of it decides nothing, as
// a place's noise has a floor of its own (rest_filter.h).
void Normalise(Noise* noise) {
  constexpr double kFactorLeast = 0.01;
  for (std::vector<double>* factors : {&noise->unit_factor, &noise->exposure_factor})
    for (double& factor : *factors) factor = std::max(factor, kFactorLeast);
  if (!noise->exposure_factor.empty()) {
    const double usual = Median(noise->exposure_factor);
    for (double& factor : noise->exposure_factor) factor /= usual;
    noise->place_um *= usual;
  }
  const double usual = Median(noise->unit_factor);
  for (double& factor : noise->unit_factor) factor /= usual;
  noise->place_um = std::max(noise->place_um * usual, noise->least_um);
  for (int axis = 0; axis < 2; ++axis)
    noise->rest_deg[axis] *= usual, noise->angle_deg[axis] *= usual;
}

void FitFactors(Fit* fit) {
  const std::size_t units = fit->model.units.size();
  std::vector<UnitLengths> lengths(units);
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      std::vector<double> weights;
      const WhiteUnit white = WhitenAnew(*fit, unit, &weights);
      for (std::size_t k = 0; k < white.moves.size(); ++k) {
        const auto at = static_cast<Eigen::Index>(2 * k);
        lengths[unit].square.push_back(white.y.segment<2>(at).squaredNorm() / weights[k]);
        lengths[unit].exposure.push_back(
            fit->facts->exposures.of_row[white.track.first_row + white.moves[k]]);
      }
    }
  });
  std::vector<double> own(units, -1), fleet;
  for (std::size_t unit = 0; unit < units; ++unit) {
    const double n = 2.0 * static_cast<double>(lengths[unit].square.size());
    const double left = n - static_cast<double>(OwnColumns(*fit, unit));
    if (left < 4) continue;
    own[unit] = Median(lengths[unit].square) / kMedianSquare * n / left;
    fleet.push_back(own[unit]);
  }
  const double usual = fleet.empty() ? 1 : Median(fleet);
  for (std::size_t unit = 0; unit < units; ++unit) {
    const double n = own[unit] < 0 ? 0 : static_cast<double>(lengths[unit].square.size());
    fit->noise.unit_factor[unit] *= Shrunk(std::max(own[unit], 0.0), n, usual);
  }
  // Exposures get what is left after the units' factors.
  constexpr std::size_t kUnitsMin = 6;
  if (units < kUnitsMin) return Normalise(&fit->noise);
  std::vector<std::vector<double>> of(fit->facts->exposures.size());
  for (std::size_t unit = 0; unit < units; ++unit)
    for (std::size_t k = 0; k < lengths[unit].square.size(); ++k)
      of[lengths[unit].exposure[k]].push_back(lengths[unit].square[k] / std::max(own[unit], 1e-6));
  std::vector<double>& factor = fit->noise.exposure_factor;
  factor.resize(of.size(), 1);
  for (std::size_t e = 0; e < of.size(); ++e)
    if (!of[e].empty())
      factor[e] *= Shrunk(Median(of[e]) / kMedianSquare, static_cast<double>(of[e].size()), 1);
  Normalise(&fit->noise);
}

}  // namespace

void UpdateNoise(Fit* fit) {
  Noise& noise = fit->noise;
  if (noise.unit_factor.empty()) noise.unit_factor.assign(fit->model.units.size(), 1);
  const std::vector<NoiseUnit> sample = Sample(*fit);
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
