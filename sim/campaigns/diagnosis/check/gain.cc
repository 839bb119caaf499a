#include "sim/campaigns/diagnosis/check/gain.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kFolds = 5;
constexpr double kOutlier = 6;  // whitened length by the final model

// The fold of each row. Blocks of neighbouring exposures are dealt out in turn. They are short, so
// that each fold has its share of every condition: of a temperature, of an elevation, of a homing.
// Where the zeros of homings are free, the blocks are homings: a few moves do not tell zeros that
// the others are judged by.
std::vector<std::size_t> FoldsOf(const Fit& fit, std::string* how) {
  constexpr std::size_t kBlocksOfFold = 10;  // half or twice as many: the same share of conditions
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<std::size_t> fold(campaign.rows());
  if (!fit.model.homing_zero_deg[kTheta].empty()) {
    *how = "5 folds of whole homings; each fold predicted from the other four";
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      std::size_t homing = 0;
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
        if (fit.facts->restarts[row] != 0 && row != campaign.first_row[unit]) ++homing;
        fold[row] = homing % kFolds;
      }
    }
    return fold;
  }
  *how = "5 folds of blocks of exposures; each fold predicted from the other four";
  const std::size_t exposures = fit.facts->exposures.size();
  const std::size_t block = std::max<std::size_t>(1, exposures / (kBlocksOfFold * kFolds));
  for (std::size_t row = 0; row < fold.size(); ++row)
    fold[row] = fit.facts->exposures.of_row[row] / block % kFolds;
  return fold;
}

// Fits the zeros of a homing that no fit has seen, from those of its exposures that are judged,
// with everything else fixed. The prior keeps what few poses do not show.
void FitHeldOutHomings(const std::vector<char>& hold, const std::vector<char>& judged, Fit* fit) {
  if (fit->model.homing_zero_deg[kTheta].empty()) return;
  constexpr int kRounds = 3;
  constexpr double kRadians = std::numbers::pi / 180;
  const Campaign& campaign = *fit->facts->campaign;
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      const UnitTrack track = TrackOf(fit->model, *fit->facts, unit);
      for (std::size_t begin = 0; begin < track.moves;) {
        const std::size_t end = EndOfHistory(track, begin);
        Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
        Eigen::Vector2d right = Eigen::Vector2d::Zero();
        bool seen = false;
        for (const std::size_t axis : {kTheta, kPhi}) {
          const auto a = static_cast<Eigen::Index>(axis);
          const double ratio = fit->noise.place_um / fit->model.homing_spread_deg[axis];
          normal(a, a) = ratio * ratio;
          right[a] = -normal(a, a) * fit->model.homing_zero_deg[axis][track.first_row + begin];
        }
        for (std::size_t i = begin; i < end; ++i) {
          seen = seen || fit->Used(track.first_row + i);
          const std::size_t row = track.first_row + i;
          if (hold[row] == 0 || judged[row] == 0 || !std::isfinite(fit->x_um[row])) continue;
          Eigen::Matrix2d j;
          j << -(track.elbow_y_mm[i] + track.reach_y_mm[i]), -track.reach_y_mm[i],
              track.elbow_x_mm[i] + track.reach_x_mm[i], track.reach_x_mm[i];
          j *= 1e3 * kRadians;
          normal += j.transpose() * j;
          right += j.transpose() * Eigen::Vector2d(fit->x_um[row], fit->y_um[row]);
        }
        const Eigen::Vector2d step = normal.ldlt().solve(right);
        for (std::size_t i = begin; i < end && !seen; ++i)
          for (const std::size_t axis : {kTheta, kPhi})
            if (hold[track.first_row + i] != 0)
              fit->model.homing_zero_deg[axis][track.first_row + i] +=
                  step[static_cast<Eigen::Index>(axis)];
        begin = end;
      }
    }
    UpdateResiduals(fit);
  }
}

Fit FitWithout(const Fit& final_fit, const std::vector<char>& hold, const std::vector<char>& judged,
               bool with_terms) {
  Fit fit = final_fit;
  for (std::size_t row = 0; row < hold.size(); ++row)
    if (hold[row] != 0) fit.aside[row] = 1;
  if (!with_terms) {
    fit.model.terms.clear();
    fit.model.events.clear();
    fit.model.exposures.clear();
  }
  UpdateResiduals(&fit);
  UpdateWeights(&fit);
  for (int round = 0; round < 2; ++round) {
    StepFit(&fit);
    UpdateWeights(&fit);
  }
  StepFit(&fit);
  FitHeldOutHomings(hold, judged, &fit);
  return fit;
}

// Whether the row's place is another one once names are right. False where no place is known under
// the old name.
bool IsUnderAnother(const Fit& as_named, const Fit& fit, std::size_t row) {
  const Campaign& a = *as_named.facts->campaign;
  const Campaign& b = *fit.facts->campaign;
  return std::isfinite(a.x_mm[row]) && (a.x_mm[row] != b.x_mm[row] || a.y_mm[row] != b.y_mm[row]);
}

// Variance of a rest error that is new by `spread` in each move, in units of spread^2. A part that
// adds up from move to move counts as after ten moves at most.
double SummedVariance(double carry) { return 1 / std::max(1 - carry * carry, 0.1); }

// Spread of an angle at one exposure.
double AngleSpread(const Noise& noise, std::size_t axis) {
  return std::sqrt(noise.angle_deg[axis] * noise.angle_deg[axis] +
                   noise.rest_deg[axis] * noise.rest_deg[axis] * SummedVariance(noise.carry[axis]));
}

}  // namespace

double NoiseFloor(const Fit& fit) {
  double sum = 0, count = 0;
  constexpr double kRadians = std::numbers::pi / 180;
  const double rest2 = fit.noise.rest_um * fit.noise.rest_um * SummedVariance(fit.noise.carry[2]);
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
    const double f2 = fit.noise.unit_factor[unit] * fit.noise.unit_factor[unit];
    const double least2 = fit.noise.least_um * fit.noise.least_um;
    for (std::size_t i = 0; i < track.moves; ++i) {
      if (!fit.Used(track.first_row + i)) continue;
      const double theta_um = 1e3 * kRadians * AngleSpread(fit.noise, 0) *
                              std::hypot(track.elbow_x_mm[i] + track.reach_x_mm[i],
                                         track.elbow_y_mm[i] + track.reach_y_mm[i]);
      const double phi_um = 1e3 * kRadians * AngleSpread(fit.noise, 1) *
                            std::hypot(track.reach_x_mm[i], track.reach_y_mm[i]);
      const double place2 = std::max(fit.noise.place_um * fit.noise.place_um, least2 / f2);
      sum += f2 * (2 * (place2 + rest2) + theta_um * theta_um + phi_um * phi_um);
      count += 1;
    }
  }
  return count > 0 ? std::sqrt(sum / count) : HeldOutGain::kNotKnown;
}

HeldOutGain MeasureGain(const Fit& fit, const Fit* as_named) {
  const Campaign& campaign = *fit.facts->campaign;
  HeldOutGain gain;
  const std::vector<std::size_t> fold = FoldsOf(fit, &gain.held_out);
  if (!fit.model.homing_zero_deg[kTheta].empty())
    gain.held_out +=
        "; before and after, the two zeros of a homing that is held out whole are its own";
  std::vector<char> judged(campaign.rows(), 0);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (std::size_t k = 0; k < white.moves.size(); ++k) {
      const std::size_t row = white.track.first_row + white.moves[k];
      const auto at = static_cast<Eigen::Index>(2 * k);
      const double length = std::hypot(white.y[at], white.y[at + 1]) / std::sqrt(fit.weight[row]);
      judged[row] = length <= kOutlier ? 1 : 0;
    }
  }
  std::vector<double> before, after;
  for (std::size_t k = 0; k < kFolds; ++k) {
    std::vector<char> hold(campaign.rows(), 0);
    for (std::size_t row = 0; row < hold.size(); ++row) hold[row] = fold[row] == k ? 1 : 0;
    const Fit plain = FitWithout(fit, hold, judged, false);
    const Fit full = FitWithout(fit, hold, judged, true);
    std::optional<Fit> misnamed;
    if (as_named != nullptr) misnamed = FitWithout(*as_named, hold, judged, false);
    for (std::size_t row = 0; row < hold.size(); ++row) {
      if (hold[row] == 0 || judged[row] == 0) continue;
      const Fit& had = misnamed && IsUnderAnother(*as_named, fit, row) ? *misnamed : plain;
      before.push_back(std::hypot(had.x_um[row], had.y_um[row]));
      after.push_back(std::hypot(full.x_um[row], full.y_um[row]));
    }
  }
  const auto rms = [](const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value * value;
    return values.empty() ? HeldOutGain::kNotKnown
                          : std::sqrt(sum / static_cast<double>(values.size()));
  };
  gain.rms_before_um = rms(before), gain.rms_after_um = rms(after);
  if (!before.empty()) gain.mad_before_um = Median(before), gain.mad_after_um = Median(after);
  gain.noise_floor_um = NoiseFloor(fit);
  const double all = gain.rms_before_um * gain.rms_before_um;
  if (all > 0)
    gain.explained_share = std::max(0.0, 1 - gain.rms_after_um * gain.rms_after_um / all);
  return gain;
}

}  // namespace focalfleet::sim
