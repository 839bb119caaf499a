#include "sim/campaigns/diagnosis/slips.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/unit_scorer.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kSlipsOfUnitMax = 40;
constexpr double kTurnsMax = 20;
constexpr double kBeside = 0.25;  // of a turn, either way: half of all steps by chance

// A unit's whitened residuals beside its geometry, and what steps make of them.
class StepRows {
 public:
  StepRows(const Fit& fit, std::size_t unit)
      : white_(Whiten(fit, unit)), geometry_(white_.y.size()), y_(white_.y) {
    for (Eigen::Index c = 0; c < white_.geometry.cols(); ++c) geometry_.Add(white_.geometry.col(c));
    geometry_.Remove(&y_);
  }

  [[nodiscard]] const UnitTrack& track() const { return white_.track; }
  [[nodiscard]] std::size_t rows() const { return white_.moves.size(); }
  [[nodiscard]] std::size_t move(std::size_t row) const { return white_.moves[row]; }

  /// The trace of a step by one degree in `move`, until the next homing.
  [[nodiscard]] Eigen::VectorXd Column(std::size_t axis, std::size_t move, bool stays) const {
    Eigen::VectorXd column = Eigen::VectorXd::Zero(y_.size());
    const std::size_t end = stays ? EndOfStep(white_.track, move) : move + 1;
    for (std::size_t k = 0; k < rows(); ++k) {
      if (white_.moves[k] < move || white_.moves[k] >= end) continue;
      for (std::size_t xy = 0; xy < 2; ++xy)
        column[static_cast<Eigen::Index>(2 * k + xy)] = white_.turn_um[4 * k + 2 * axis + xy];
    }
    white_.Apply(column.data());
    geometry_.Remove(&column);
    return column;
  }
  /// A jump of the axis before a row, by the rows on either side: b and g of a step of one degree
  /// there, with the level before it free. Rows near by tell it, whatever other jumps there are.
  struct Jump {
    double b = 0, g = 0;
  };
  [[nodiscard]] Jump JumpAt(std::size_t axis, std::size_t row) const {
    constexpr std::size_t kEitherSide = 8;
    double all_g = 0, all_b = 0, behind_g = 0, behind_b = 0;
    const std::size_t begin = row - std::min(row, kEitherSide);
    for (std::size_t k = begin; k < std::min(rows(), row + kEitherSide); ++k) {
      // Rows of other histories tell nothing of this one.
      const std::size_t first = std::min(k, row - 1), last = std::max(k, row);
      if (EndOfStep(white_.track, move(first)) <= move(last)) continue;
      const double* t = &white_.turn_um[4 * k + 2 * axis];
      const double* w = white_.filter[k].w;
      const double x = w[0] * t[0] + w[1] * t[1], y = w[1] * t[0] + w[2] * t[1];
      const auto at = static_cast<Eigen::Index>(2 * k);
      const double g = x * x + y * y, b = x * y_[at] + y * y_[at + 1];
      all_g += g, all_b += b;
      if (k >= row) behind_g += g, behind_b += b;
    }
    if (!(all_g > 0)) return {};
    const double share = behind_g / all_g;
    return {behind_b - share * all_b, behind_g - share * behind_g};
  }
  /// Whether the axis moves after one move and up to another.
  [[nodiscard]] bool Moves(std::size_t axis, std::size_t after, std::size_t to) const {
    for (std::size_t move = after + 1; move <= to; ++move)
      if (white_.track.step_deg[axis][move] != 0) return true;
    return false;
  }
  [[nodiscard]] const Eigen::VectorXd& left() const { return y_; }
  void Take(const Eigen::VectorXd& column, double step_deg) { y_ -= step_deg * column; }

 private:
  WhiteUnit white_;
  Basis geometry_;
  Eigen::VectorXd y_;
};

// The longest move after one seen row and up to the next that went the other way; 0: none.
std::size_t MoveAgainst(const UnitTrack& track, std::size_t axis, std::size_t after, std::size_t to,
                        double turns) {
  std::size_t best = 0;
  double most = 0;
  for (std::size_t move = after + 1; move <= to; ++move) {
    const double step = track.step_deg[axis][move];
    if (step * turns < 0 && std::abs(step) > most) most = std::abs(step), best = move;
  }
  return best;
}

struct Slip {
  std::size_t axis = kTheta, move = 0;
  double step_deg = 0, log_ratio = 0;
};

Slip BestSlip(const StepRows& rows) {
  Slip best;
  for (const std::size_t axis : {kTheta, kPhi}) {
    const double turn = 360 / rows.track().unit->gear[axis];
    for (std::size_t k = 1; k < rows.rows(); ++k) {
      const std::size_t from = rows.move(k - 1), to = rows.move(k);
      if (EndOfHistory(rows.track(), from) <= to || !rows.Moves(axis, from, to)) continue;
      const auto [b, g] = rows.JumpAt(axis, k);
      if (!(g > 0)) continue;
      const double turns = std::clamp(std::round(b / g / turn), -kTurnsMax, kTurnsMax);
      const double step_deg = turns * turn, log_ratio = step_deg * b - step_deg * step_deg * g / 2;
      // A step that lies between two numbers of turns is none of a rotor.
      const bool is_whole = std::abs(b / g - step_deg) <= kBeside * turn;
      if (turns == 0 || !is_whole || log_ratio <= best.log_ratio) continue;
      if (const std::size_t move = MoveAgainst(rows.track(), axis, from, to, turns); move != 0)
        best = {axis, move, step_deg, log_ratio};
    }
  }
  return best;
}

}  // namespace

std::vector<EventTerm> FindSlips(const Fit& fit, std::size_t unit, double family_wise) {
  std::vector<EventTerm> slips;
  if (!fit.UsesUnit(unit)) return slips;
  StepRows rows(fit, unit);
  // Each axis may slip in each move by any number of turns.
  const double could_be = 2 * static_cast<double>(fit.facts->campaign->rows()) * 2 * kTurnsMax;
  const double least = std::log(could_be / family_wise);
  // A unit that slips again and again looks like a noisy one until its slips are known. Its noise
  // is that of the others here.
  const double factor = std::max(fit.noise.unit_factor[unit], 1.0);
  while (slips.size() < kSlipsOfUnitMax) {
    const Slip slip = BestSlip(rows);
    if (slip.log_ratio * factor * factor <= least) break;
    slips.push_back({unit, rows.track().first_row + slip.move, slip.axis, true, slip.step_deg});
    rows.Take(rows.Column(slip.axis, slip.move, true), slip.step_deg);
  }
  return slips;
}

std::vector<double> LogLikelihoodOfEvents(const Fit& fit) {
  std::vector<double> ratios;
  for (const EventTerm& event : fit.model.events) {
    const StepRows rows(fit, event.unit);
    const Eigen::VectorXd column =
        rows.Column(event.axis, event.row - rows.track().first_row, event.stays);
    // The residuals without the step are those with it, and the step.
    const double b = column.dot(rows.left()) + event.step_deg * column.squaredNorm();
    ratios.push_back(std::max(
        event.step_deg * b - event.step_deg * event.step_deg * column.squaredNorm() / 2, 0.0));
  }
  return ratios;
}

}  // namespace focalfleet::sim
