#include "sim/campaigns/diagnosis/terms/slips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "sim/campaigns/diagnosis/score/unit_scorer.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kSlipsOfUnitMax = 40;
constexpr double kTurnsMax = 20;
// Share of a turn by which a step may lie beside a whole number of turns, either way. Chance passes
// half of all steps. With 0.125 one of nine slips of a unit is taken for one of the other axis;
// with 0.5 every step passes, and steps that are none are taken again and again.
constexpr double kBeside = 0.25;

// Columns of a row, side by side: the geometry's, and the residual.
constexpr Eigen::Index kGeometryColumns = 6, kStepColumns = kGeometryColumns + 1;
using StepProducts = Eigen::Matrix<double, kStepColumns, kStepColumns>;

// A unit's whitened residuals beside its geometry, and what steps make of them.
class StepRows {
 public:
  StepRows(const Fit& fit, std::size_t unit)
      : white_(Whiten(fit, unit)), geometry_(white_.y.size()), y_(white_.y) {
    for (Eigen::Index c = 0; c < white_.geometry.cols(); ++c) geometry_.Add(white_.geometry.col(c));
    geometry_.Remove(&y_);
    AddUp();
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
  struct Jump {
    double b = 0, g = 0;
  };
  /// A step of one degree of each axis before a row, by at most `either_side` rows on each side: b
  /// and g with the geometry free in these rows alone. A unit's geometry is bent by the steps that
  /// are not found yet; free here, it takes nothing from a jump.
  [[nodiscard]] std::array<Jump, 2> JumpsAt(std::size_t row, std::size_t either_side,
                                            double least) const {
    std::size_t begin = row - std::min(row, either_side);
    std::size_t end = std::min(rows(), row + either_side);
    // Rows of other histories tell nothing of this one.
    while (EndOfStep(white_.track, move(begin)) <= move(row - 1)) ++begin;
    while (EndOfStep(white_.track, move(row)) <= move(end - 1)) --end;
    const StepProducts all = sums_[end] - sums_[begin];
    Eigen::Matrix<double, kGeometryColumns, kGeometryColumns> gram =
        all.topLeftCorner<kGeometryColumns, kGeometryColumns>();
    // Share of each column's square, above rounding. Half and double of it find the same slips.
    constexpr double kDependent = 1e-9;
    gram.diagonal() += kDependent * gram.diagonal();
    gram.diagonal().array() += 1e-300;  // a column of zeros
    const auto solver = gram.ldlt();
    const Eigen::Matrix<double, kGeometryColumns, 1> level =
        solver.solve(all.block<kGeometryColumns, 1>(0, kGeometryColumns));
    const double square = all(kGeometryColumns, kGeometryColumns) -
                          level.dot(all.block<kGeometryColumns, 1>(0, kGeometryColumns));
    if (square / 2 <= least) return {};
    const auto at = static_cast<Eigen::Index>(2 * row);
    const auto size = static_cast<Eigen::Index>(2 * (end - row));
    const auto geometry = white_.geometry.middleRows(at, size);
    std::array<Jump, 2> jumps;
    for (const std::size_t axis : {kTheta, kPhi}) {
      const Eigen::VectorXd column = Behind(axis, row, end);
      Eigen::Matrix<double, kGeometryColumns, 1> with =
          Eigen::Matrix<double, kGeometryColumns, 1>::Zero();
      with.head(geometry.cols()) = geometry.transpose() * column;
      jumps[axis] = {column.dot(y_.segment(at, size)) - with.dot(level),
                     column.squaredNorm() - with.dot(solver.solve(with))};
    }
    return jumps;
  }
  [[nodiscard]] const Eigen::VectorXd& left() const { return y_; }
  void Take(const Eigen::VectorXd& column, double step_deg) {
    y_ -= step_deg * column;
    AddUp();
  }

 private:
  // A step of one degree as the rows from `row` to `end` show it, whitened.
  [[nodiscard]] Eigen::VectorXd Behind(std::size_t axis, std::size_t row, std::size_t end) const {
    Eigen::VectorXd column(static_cast<Eigen::Index>(2 * (end - row)));
    for (std::size_t k = row; k < end; ++k)
      for (std::size_t xy = 0; xy < 2; ++xy)
        column[static_cast<Eigen::Index>(2 * (k - row) + xy)] =
            white_.turn_um[4 * k + 2 * axis + xy];
    ApplyFilter(std::span(white_.filter).subspan(row, end - row),
                std::span(white_.turn_um).subspan(4 * row, 4 * (end - row)), column.data());
    return column;
  }
  // Sums of the columns' products over all rows before each.
  void AddUp() {
    sums_.assign(1, StepProducts::Zero());
    for (std::size_t k = 0; k < rows(); ++k) {
      Eigen::Matrix<double, 2, kStepColumns> columns =
          Eigen::Matrix<double, 2, kStepColumns>::Zero();
      const auto at = static_cast<Eigen::Index>(2 * k);
      columns.leftCols(white_.geometry.cols()) = white_.geometry.middleRows<2>(at);
      columns.col(kGeometryColumns) = y_.segment<2>(at);
      sums_.push_back(sums_.back() + columns.transpose() * columns);
    }
  }

  WhiteUnit white_;
  Basis geometry_;
  Eigen::VectorXd y_;
  std::vector<StepProducts> sums_;  // Shape: (rows + 1)
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

// Rows on either side that a jump is looked for by. The narrowest that shows a slip has the fewest
// other slips within it: narrowest over threshold, Baranowski et al., J. R. Stat. Soc. B 81, 649.
// With half of these rows eight of nine slips of a unit are found, with twice as many all nine.
constexpr std::array<std::size_t, 3> kEitherSide = {4, 8, 16};

// The likeliest slip with a likelihood ratio above e^least, by as few rows as show one.
Slip BestSlip(const StepRows& rows, double least) {
  Slip best{.log_ratio = least};
  for (const std::size_t either_side : kEitherSide) {
    for (std::size_t k = 1; k < rows.rows(); ++k) {
      const std::size_t from = rows.move(k - 1), to = rows.move(k);
      if (EndOfHistory(rows.track(), from) <= to) continue;
      const std::array<StepRows::Jump, 2> jumps = rows.JumpsAt(k, either_side, best.log_ratio);
      for (const std::size_t axis : {kTheta, kPhi}) {
        const auto [b, g] = jumps[axis];
        if (!(g > 0)) continue;
        const double turn = 360 / rows.track().unit->gear[axis];
        const double turns = std::clamp(std::round(b / g / turn), -kTurnsMax, kTurnsMax);
        const double step_deg = turns * turn;
        const double log_ratio = step_deg * b - step_deg * step_deg * g / 2;
        // A step that lies between two numbers of turns is none of a rotor.
        const bool is_whole = std::abs(b / g - step_deg) <= kBeside * turn;
        if (turns == 0 || !is_whole || log_ratio <= best.log_ratio) continue;
        if (const std::size_t move = MoveAgainst(rows.track(), axis, from, to, turns); move != 0)
          best = {axis, move, step_deg, log_ratio};
      }
    }
    if (best.move != 0) break;
  }
  return best;
}

}  // namespace

std::vector<EventTerm> FindSlips(const Fit& fit, std::size_t unit, double family_wise) {
  std::vector<EventTerm> slips;
  if (!fit.UsesUnit(unit)) return slips;
  StepRows rows(fit, unit);
  // Each axis may slip in each move by any number of turns, and is looked at by several rows.
  const double could_be = 2 * static_cast<double>(fit.facts->campaign->rows()) * 2 * kTurnsMax *
                          static_cast<double>(kEitherSide.size());
  // A unit that slips again and again looks like a noisy one until its slips are known. Its noise
  // is that of the others here.
  const double factor = std::max(fit.noise.unit_factor[unit], 1.0);
  const double least = std::log(could_be / family_wise) / (factor * factor);
  while (slips.size() < kSlipsOfUnitMax) {
    const Slip slip = BestSlip(rows, least);
    if (slip.move == 0) break;
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
