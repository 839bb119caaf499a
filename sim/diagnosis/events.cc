#include "sim/diagnosis/events.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace focalfleet::sim {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kChiSquareMin = 50;  // best of some hundred places and axes, in thousands of units
constexpr std::size_t kEventsMax = 6;  // of a unit
constexpr std::size_t kLastsMin = 3;   // exposures: fewer may be outliers
constexpr double kNear = 3.5;          // sigmas from a size that physics has
constexpr double kStepMin_deg = 2;     // a lost command below it cannot be told from other steps
constexpr int kTurnsMax = 20;

struct StepFound {
  std::size_t move = 0, axis = kTheta;
  double size_deg = 0, sigma_deg = 0, chi_square = 0;
};

// The step with the largest chi-square beside the unit's geometry.
StepFound BestStep(const WhiteUnit& white, const VectorXd& y) {
  const Eigen::HouseholderQR<MatrixXd> qr(white.geometry);
  const MatrixXd q =
      qr.householderQ() * MatrixXd::Identity(white.geometry.rows(), white.geometry.cols());
  const VectorXd left = y - q * (q.transpose() * y);
  StepFound best;
  PoseErrors errors;
  VectorXd m(y.size());
  for (const std::size_t axis : {kTheta, kPhi})
    for (std::size_t move = 1; move < white.track.moves; ++move) {
      if (white.track.step_deg[axis][move] == 0) continue;
      errors.Reset(white.track.moves);
      std::size_t i = move;
      for (; i < white.track.moves && (i == move || white.track.restarts[i] == 0); ++i)
        errors.angle_deg[axis][i] = 1;
      if (i - move < kLastsMin) continue;
      WhiteDisplacement(white, errors, m.data());
      m -= q * (q.transpose() * m);
      const double g = m.squaredNorm(), b = m.dot(left);
      if (g <= 0 || b * b / g <= best.chi_square) continue;
      best = {move, axis, b / g, 1 / std::sqrt(g), b * b / g};
    }
  return best;
}

// The size that physics has near the found one; 0: none.
double SizeOfPhysics(const UnitTrack& track, const StepFound& found) {
  const double step = track.step_deg[found.axis][found.move];
  const double tolerance = std::max(kNear * found.sigma_deg, 1e-3);
  if (std::abs(step) > kStepMin_deg)
    for (const double size : {-step, step})
      if (std::abs(found.size_deg - size) < std::max(tolerance, 0.005 * std::abs(step)))
        return size;
  const double turn = 360 / track.unit->gear[found.axis];
  const double turns = std::round(found.size_deg / turn);
  const bool against = turns * step < 0;
  if (turns == 0 || std::abs(turns) > kTurnsMax || !against || tolerance > 0.25 * turn) return 0;
  return std::abs(found.size_deg - turns * turn) < tolerance ? turns * turn : 0;
}

bool IsLostCommand(const Fit& fit, const EventTerm& event) {
  const double step = fit.facts->step_deg[event.axis][event.row];
  return std::abs(std::abs(event.step_deg) - std::abs(step)) < 1e-9;
}

}  // namespace

std::size_t AddEvents(Fit* fit) {
  const std::size_t units = fit->model.units.size();
  std::vector<std::vector<EventTerm>> of_unit(units);
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit) {
      const WhiteUnit white = Whiten(*fit, unit);
      if (white.moves.size() < 8) continue;
      VectorXd y = white.y;
      PoseErrors errors;
      VectorXd m(y.size());
      while (of_unit[unit].size() < kEventsMax) {
        const StepFound found = BestStep(white, y);
        if (found.chi_square < kChiSquareMin) break;
        const double size = SizeOfPhysics(white.track, found);
        if (size == 0) break;
        of_unit[unit].push_back({unit, white.track.first_row + found.move, found.axis, true, size});
        errors.Reset(white.track.moves);
        for (std::size_t i = found.move; i < white.track.moves; ++i) {
          if (i > found.move && white.track.restarts[i] != 0) break;
          errors.angle_deg[found.axis][i] = size;
        }
        WhiteDisplacement(white, errors, m.data());
        y -= m;
      }
    }
  });
  std::size_t added = 0;
  for (const auto& events : of_unit)
    for (const EventTerm& event : events) fit->model.events.push_back(event), ++added;
  if (added > 0) {
    UpdateResiduals(fit);
    SettleFit(fit, 3);
  }
  return added;
}

std::vector<CauseFound> EventCauses(const Fit& fit) {
  std::vector<CauseFound> causes;
  for (const bool lost_command : {false, true}) {
    CauseFound cause;
    cause.cause = lost_command ? "lost_command" : "step_loss";
    cause.candidates = {cause.cause};
    cause.scope = "unit";
    cause.amplitude_unit = "events";
    std::set<std::uint32_t> units;
    std::set<std::size_t> axes;
    double square = 0;
    for (const EventTerm& event : fit.model.events) {
      if (IsLostCommand(fit, event) != lost_command) continue;
      cause.amplitude += 1;
      const CampaignUnit& unit = fit.model.units[event.unit];
      units.insert(unit.id);
      axes.insert(event.axis);
      const double lever_mm =
          event.axis == kPhi ? unit.arm_mm[kPhi] : std::hypot(unit.arm_mm[0], unit.arm_mm[1]);
      square += std::pow(1e3 * lever_mm * event.step_deg * std::numbers::pi / 180, 2);
    }
    if (cause.amplitude == 0) continue;
    cause.axis = axes.size() > 1 ? "both" : *axes.begin() == kTheta ? "theta" : "phi";
    cause.units.assign(units.begin(), units.end());
    cause.all_units = units.size() == fit.model.units.size();
    cause.ci95[0] = cause.ci95[1] = cause.amplitude;
    cause.size_um = std::sqrt(square / cause.amplitude);
    cause.delta_log_likelihood = kChiSquareMin / 2 * cause.amplitude;
    cause.paragraph = lost_command
                          ? "A whole move was not made, or made twice: look at the bus and its "
                            "error counters."
                          : "The rotor lost its field for whole motor turns: raise the drive, "
                            "slow down, or look for what blocks the axis; home the unit.";
    causes.push_back(std::move(cause));
  }
  return causes;
}

}  // namespace focalfleet::sim
