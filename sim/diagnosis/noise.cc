// Noise and weights of a fit (fit.h, whiten.h): variances by maximum likelihood with the density of
// Student's t, in which outliers cost a logarithm; then factors of units and of exposures.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "sim/diagnosis/chances.h"
#include "sim/diagnosis/fit.h"
#include "sim/diagnosis/rest_filter.h"

namespace focalfleet::sim {
namespace {

constexpr double kMedianSquare = 2 * std::numbers::ln2;  // of a whitened 2-D normal residual
constexpr double kPlaceNoiseMin_um = 0.02;
constexpr std::size_t kRowsMax = 8000;  // of those that the variances come from
constexpr std::size_t kRowsMin = 200;   // fewer: one variance only

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
};

// Whole units, evenly from the fleet.
std::vector<NoiseUnit> Sample(const Fit& fit) {
  const Campaign& campaign = *fit.facts->campaign;
  const std::size_t units = campaign.units.size();
  const std::size_t stride = std::max<std::size_t>(1, (campaign.rows() + kRowsMax - 1) / kRowsMax);
  std::vector<NoiseUnit> sample;
  for (std::size_t unit = 0; unit < units; unit += stride) {
    NoiseUnit one{fit.noise.unit_factor[unit], {}};
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
    sample.push_back(std::move(one));
  }
  return sample;
}

// Student's t of 5 degrees of freedom in two dimensions, for each place given those before it.
double Cost(const std::vector<NoiseUnit>& sample, const Noise& noise) {
  constexpr double kFreedom = 5;
  double cost = 0;
  double white[2];
  for (const NoiseUnit& unit : sample) {
    RestFilter filter(noise, unit.factor);
    for (const NoiseMove& move : unit.moves) {
      filter.Move(move.restarts, move.theta_moves, move.phi_moves);
      if (!move.seen) continue;
      filter.See(move.turn_um, move.exposure_factor);
      const double square = filter.SquareLength(move.x_um, move.y_um);
      cost +=
          std::log(filter.determinant()) / 2 + (kFreedom + 2) / 2 * std::log1p(square / kFreedom);
      const RowFilter row = filter.Take(std::min(1.0, (kFreedom + 2) / (kFreedom + square)));
      filter.Whiten(row, move.turn_um, move.x_um, move.y_um, white);
    }
  }
  return cost;
}

// Coordinate search in the logarithms of the spreads, and in the shares carried.
void Search(const std::vector<NoiseUnit>& sample, bool with_axes, double widest, Noise* noise) {
  double cost = Cost(sample, *noise);
  const auto attempt = [&](double Noise::*field, double value) {
    Noise next = *noise;
    next.*field = value;
    const double next_cost = Cost(sample, next);
    if (next_cost < cost) cost = next_cost, *noise = next;
  };
  const auto attempt_axis = [&](double(Noise::*field)[2], int axis, double value) {
    Noise next = *noise;
    (next.*field)[axis] = value;
    const double next_cost = Cost(sample, next);
    if (next_cost < cost) cost = next_cost, *noise = next;
  };
  for (double factor = widest; factor > 1.015; factor = std::sqrt(factor)) {
    for (const double f : {factor, 1 / factor}) attempt(&Noise::place_um, noise->place_um * f);
    if (!with_axes) continue;
    for (int axis = 0; axis < 2; ++axis) {
      for (const double f : {factor, 1 / factor}) {
        attempt_axis(&Noise::rest_deg, axis, noise->rest_deg[axis] * f);
        attempt_axis(&Noise::angle_deg, axis, noise->angle_deg[axis] * f);
      }
      const double wide = 0.5 * (factor - 1);
      for (const double d : {wide, -wide})
        attempt_axis(&Noise::carry, axis, std::clamp(noise->carry[axis] + d, 0.0, 1.0));
    }
  }
}

double Lever_um(const std::vector<NoiseUnit>& sample, int axis) {
  double most = 0;
  for (const NoiseUnit& unit : sample)
    for (const NoiseMove& move : unit.moves)
      most = std::max(most, std::hypot(move.turn_um[2 * axis], move.turn_um[2 * axis + 1]));
  return most;
}

void FitVariances(const std::vector<NoiseUnit>& sample, bool with_axes, Noise* noise) {
  std::vector<double> squares;
  for (const NoiseUnit& unit : sample)
    for (const NoiseMove& move : unit.moves)
      if (move.seen)
        squares.push_back((move.x_um * move.x_um + move.y_um * move.y_um) /
                          (unit.factor * unit.factor));
  if (squares.empty()) return;
  with_axes = with_axes && squares.size() >= kRowsMin;
  const double typical = std::max(std::sqrt(Median(squares) / kMedianSquare), kPlaceNoiseMin_um);
  // Near where it was: a short search. Anew where it was never made, or is far away.
  const bool near =
      noise->fitted && typical < 2 * noise->typical_um && typical > 0.5 * noise->typical_um;
  if (!near) {
    noise->place_um = typical;
    for (int axis = 0; axis < 2; ++axis) {
      const double lever = std::max(Lever_um(sample, axis), 1e-6);
      noise->rest_deg[axis] = with_axes ? 0.3 * typical / lever : 0;
      noise->angle_deg[axis] = with_axes ? 0.1 * typical / lever : 0;
      noise->carry[axis] = 0;
    }
  }
  Search(sample, with_axes, near ? 1.5 : 8, noise);
  noise->fitted = true;
  noise->typical_um = typical;
  noise->place_um = std::max(noise->place_um, kPlaceNoiseMin_um);
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
  // Exposures: what is left once the units have theirs.
  constexpr std::size_t kUnitsMin = 6;
  if (units < kUnitsMin) return;
  std::vector<std::vector<double>> of(fit->facts->exposures.size());
  for (std::size_t unit = 0; unit < units; ++unit)
    for (std::size_t k = 0; k < lengths[unit].square.size(); ++k)
      of[lengths[unit].exposure[k]].push_back(lengths[unit].square[k] / std::max(own[unit], 1e-6));
  std::vector<double>& factor = fit->noise.exposure_factor;
  factor.resize(of.size(), 1);
  for (std::size_t e = 0; e < of.size(); ++e)
    if (!of[e].empty())
      factor[e] *= Shrunk(Median(of[e]) / kMedianSquare, static_cast<double>(of[e].size()), 1);
}

}  // namespace

void UpdateNoise(Fit* fit) {
  Noise& noise = fit->noise;
  if (noise.unit_factor.empty()) noise.unit_factor.assign(fit->model.units.size(), 1);
  const std::vector<NoiseUnit> sample = Sample(*fit);
  FitVariances(sample, fit->with_axis_noise, &noise);
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
