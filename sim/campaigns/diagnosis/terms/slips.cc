#include "sim/campaigns/diagnosis/terms/slips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <span>
#include <utility>

#include "sim/campaigns/diagnosis/score/unit_scorer.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kSlipsOfUnitMax = 40;
// The probability from which a slip is taken, where others are known: as that of a name.
constexpr double kSure = 0.9;
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
  /// The first row from this one on that would show a turn of the axis, above its noise, within the
  /// same history. Folded arms do not show where theta stands.
  [[nodiscard]] std::size_t RowThatShows(std::size_t axis, std::size_t row) const {
    const double turn = 360 / white_.track.unit->gear[axis];
    const std::size_t end = EndOfStep(white_.track, move(row));
    while (row + 1 < rows() && move(row + 1) < end && turn * Behind(axis, row, row + 1).norm() < 1)
      ++row;
    return row;
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

constexpr std::size_t kNoMove = std::numeric_limits<std::size_t>::max();

// The longest move from one to another that went against a slip by so many turns.
std::size_t MoveAgainst(const UnitTrack& track, std::size_t axis, std::size_t from, std::size_t to,
                        double turns) {
  std::size_t best = kNoMove;
  double most = 0;
  for (std::size_t move = from; move <= to; ++move) {
    const double step = track.step_deg[axis][move];
    if (step * turns < 0 && std::abs(step) > most) most = std::abs(step), best = move;
  }
  return best;
}

struct Slip {
  std::size_t axis = kTheta, move = kNoMove;
  double step_deg = 0;
  double above = 0;  // its price, in ln of the likelihood ratio
};

// What a slip has to exceed, and where it may be.
struct SlipRule {
  const SlipPrices& prices;
  double scale = 1;  // of the prices

  // Takes a step of the axis by b / g, in the moves from one to another, if it is a better slip.
  void Try(const StepRows& rows, std::size_t axis, const StepRows::Jump& jump, std::size_t from,
           std::size_t to, Slip* best) const {
    const auto [b, g] = jump;
    if (!(g > 0)) return;
    const double turn = 360 / rows.track().unit->gear[axis];
    const double turns = std::round(b / g / turn), step_deg = turns * turn;
    // A step that lies between two numbers of turns is none of a rotor.
    const bool is_whole = std::abs(b / g - step_deg) <= kBeside * turn;
    if (turns == 0 || std::abs(turns) > kSlipTurnsMax || !is_whole) return;
    const double log_ratio = step_deg * b - step_deg * step_deg * g / 2;
    const double price = scale * prices[axis][static_cast<std::size_t>(std::abs(turns)) - 1];
    if (log_ratio - price <= best->above) return;
    const std::size_t move = MoveAgainst(rows.track(), axis, from, to, turns);
    if (move != kNoMove) *best = {axis, move, step_deg, log_ratio - price};
  }
};

// Rows on either side that a jump is looked for by. The narrowest that shows a slip has the fewest
// other slips within it: narrowest over threshold, Baranowski et al., J. R. Stat. Soc. B 81, 649.
// With half of these rows eight of nine slips of a unit are found, with twice as many all nine.
constexpr std::array<std::size_t, 3> kEitherSide = {4, 8, 16};

// The first move after the last homing up to this row, or after the row before it.
std::size_t BeginBefore(const StepRows& rows, std::size_t row) {
  std::size_t begin = rows.move(row - 1) + 1;
  for (std::size_t end = EndOfHistory(rows.track(), rows.move(row - 1)); end <= rows.move(row);
       end = EndOfHistory(rows.track(), end))
    begin = end;
  return begin;
}

// The slip that is farthest above its price, by as few rows as show one. A slip before the first
// row that is seen after a homing shows beside the rows before the homing.
Slip BestSlip(const StepRows& rows, const SlipRule& rule) {
  const double least = rule.scale * std::min(std::ranges::min(rule.prices[kTheta]),
                                             std::ranges::min(rule.prices[kPhi]));
  Slip best;
  for (const std::size_t either_side : kEitherSide) {
    for (std::size_t k = 1; k < rows.rows(); ++k) {
      const std::array<StepRows::Jump, 2> jumps = rows.JumpsAt(k, either_side, best.above + least);
      for (const std::size_t axis : {kTheta, kPhi})
        rule.Try(rows, axis, jumps[axis], BeginBefore(rows, k),
                 rows.move(rows.RowThatShows(axis, k)), &best);
    }
    if (best.move != kNoMove) break;
  }
  return best;
}

}  // namespace

namespace {

// Whole turns of the slip, 1 to kSlipTurnsMax.
std::size_t TurnsOf(const Fit& fit, const EventTerm& slip) {
  const double turns = std::abs(slip.step_deg) * fit.model.units[slip.unit].gear[slip.axis] / 360;
  return static_cast<std::size_t>(std::clamp<double>(std::round(turns), 1, kSlipTurnsMax));
}

}  // namespace

bool IsSlip(const Fit& fit, const EventTerm& event) {
  const double turns = event.step_deg * fit.model.units[event.unit].gear[event.axis] / 360;
  return std::abs(turns - std::round(turns)) < 1e-6;
}

SlipPrices PricesOfFirst(const Fit& fit, double family_wise) {
  // Each axis may slip in each move by any number of turns, and is looked at by several rows.
  const double could_be = 2 * static_cast<double>(fit.facts->campaign->rows()) * 2 * kSlipTurnsMax *
                          static_cast<double>(kEitherSide.size());
  SlipPrices prices;
  for (auto& of_axis : prices) of_axis.fill(std::log(could_be / family_wise));
  return prices;
}

SlipPrices PricesByCount(const Fit& fit, std::span<const EventTerm> known, std::size_t unit) {
  // Counts have half of one more: the mean of Jeffreys' posterior.
  const Campaign& campaign = *fit.facts->campaign;
  const auto moves = [&](std::size_t one) {
    return static_cast<double>(campaign.first_row[one + 1] - campaign.first_row[one]);
  };
  std::vector<char> slips(campaign.units.size(), 0);
  std::array<double, kSlipTurnsMax> of_turns{};
  std::array<double, 2> of_axis{};
  for (const EventTerm& slip : known) {
    slips[slip.unit] = 1;
    of_turns[TurnsOf(fit, slip) - 1] += 1;
    of_axis[slip.axis] += 1;
  }
  double units = 0, slipping = 0, could_be = 0;
  for (std::size_t one = 0; one < slips.size(); ++one) {
    units += fit.UsesUnit(one) ? 1 : 0;
    if (slips[one] != 0) slipping += 1, could_be += moves(one);
  }
  const auto count = static_cast<double>(known.size());
  const double rate = (count + 0.5) / (could_be + 1);
  double slips_at_all = 1;
  if (slips[unit] == 0) {
    const double share = (slipping + 0.5) / (units + 1);
    const double unseen = share * std::exp(-rate * moves(unit));
    slips_at_all = unseen / (unseen + 1 - share);
  }
  SlipPrices prices;
  for (const std::size_t axis : {kTheta, kPhi})
    for (std::size_t k = 0; k < prices[axis].size(); ++k) {
      const double of_size = (of_turns[k] + 0.5) / (count + 0.5 * kSlipTurnsMax);
      const double of_this_axis = (of_axis[axis] + 0.5) / (count + 1);
      prices[axis][k] = std::log(kSure / (1 - kSure)) -
                        std::log(slips_at_all * rate * of_this_axis * of_size) +
                        std::log(static_cast<double>(kEitherSide.size()));
    }
  return prices;
}

namespace {

// The rows with and without slips.
class TakenSlips {
 public:
  TakenSlips(StepRows* rows, const SlipRule& rule) : rows_(*rows), rule_(rule) {}

  /// Takes slips, one after the other, and looks at each once more beside all others: one that was
  /// told by few rows may be another one by all.
  void Find() {
    while (slips_.size() < kSlipsOfUnitMax) {
      const Slip slip = BestSlip(rows_, rule_);
      if (slip.move == kNoMove) break;
      Add(slip);
    }
    constexpr int kSweeps = 3;
    for (int sweep = 0; sweep < kSweeps && (DropPairs() || Exchange()); ++sweep) {
    }
  }
  [[nodiscard]] const std::vector<Slip>& slips() const { return slips_; }
  [[nodiscard]] double Cost() const {
    double cost = rows_.left().squaredNorm() / 2;
    for (const Slip& slip : slips_) cost += PriceOf(slip);
    return cost;
  }

 private:
  [[nodiscard]] double PriceOf(const Slip& slip) const {
    const double turn = 360 / rows_.track().unit->gear[slip.axis];
    const auto turns = static_cast<std::size_t>(std::lround(std::abs(slip.step_deg) / turn));
    return rule_.scale * rule_.prices[slip.axis][turns - 1];
  }
  void Add(const Slip& slip) {
    rows_.Take(rows_.Column(slip.axis, slip.move, true), slip.step_deg);
    slips_.push_back(slip);
  }
  Slip Remove(std::size_t at) {
    const Slip slip = slips_[at];
    slips_.erase(slips_.begin() + static_cast<std::ptrdiff_t>(at));
    rows_.Take(rows_.Column(slip.axis, slip.move, true), -slip.step_deg);
    return slip;
  }
  // The best slip by all rows of its history.
  [[nodiscard]] Slip BestByAll() const {
    Slip best;
    for (std::size_t k = 0; k < rows_.rows(); ++k) {
      const std::size_t from = k == 0 ? 0 : BeginBefore(rows_, k);
      for (const std::size_t axis : {kTheta, kPhi}) {
        const Eigen::VectorXd column = rows_.Column(axis, rows_.move(k), true);
        rule_.Try(rows_, axis, {column.dot(rows_.left()), column.squaredNorm()}, from,
                  rows_.move(rows_.RowThatShows(axis, k)), &best);
      }
    }
    return best;
  }
  // Exchanges each slip for the one that does best in its place, or drops it. True: any was.
  bool Exchange() {
    bool changed = false;
    for (std::size_t left = slips_.size(); left > 0; --left) {
      const double before = Cost();
      const Slip own = Remove(0);
      const double without = Cost();
      const Slip best = BestByAll();
      if (best.move != kNoMove) Add(best);
      if (Cost() < std::min(before, without) - kRounding) {
        changed = true;
        continue;
      }
      if (best.move != kNoMove) Remove(slips_.size() - 1);
      if (without < before - kRounding)
        changed = true;
      else
        Add(own);
    }
    return changed;
  }
  // Drops two slips of one move that do not pay together. True: any were dropped.
  bool DropPairs() {
    for (std::size_t a = 0; a < slips_.size(); ++a)
      for (std::size_t b = a + 1; b < slips_.size(); ++b) {
        if (slips_[a].move != slips_[b].move) continue;
        const double before = Cost();
        const Slip later = Remove(b), earlier = Remove(a);
        if (Cost() < before - kRounding) return true;
        Add(earlier), Add(later);
      }
    return false;
  }

  static constexpr double kRounding = 1e-6;
  StepRows& rows_;
  SlipRule rule_;
  std::vector<Slip> slips_;
};

std::vector<EventTerm> EventsOf(const std::vector<Slip>& slips, std::size_t unit,
                                const StepRows& rows) {
  std::vector<EventTerm> events;
  for (const Slip& slip : slips)
    events.push_back({unit, rows.track().first_row + slip.move, slip.axis, true, slip.step_deg});
  return events;
}

}  // namespace

std::vector<EventTerm> FindSlips(const Fit& fit, std::size_t unit, const SlipPrices& prices,
                                 bool noisy) {
  if (!fit.UsesUnit(unit)) return {};
  // A unit that slips again and again looks like a noisy one until its slips are known. Its noise
  // is that of the others here.
  const double factor = noisy ? std::max(fit.noise.unit_factor[unit], 1.0) : 1;
  StepRows rows(fit, unit);
  TakenSlips taken(&rows, {prices, 1 / (factor * factor)});
  taken.Find();
  return EventsOf(taken.slips(), unit, rows);
}

std::optional<std::vector<EventTerm>> SlipsAnew(const Fit& fit, std::size_t unit,
                                                const SlipPrices& prices, double price_of_other) {
  if (!fit.UsesUnit(unit)) return std::nullopt;
  StepRows rows(fit, unit);
  double as_is = rows.left().squaredNorm() / 2;
  std::set<std::size_t> other_moves;
  for (const EventTerm& event : fit.model.events) {
    if (event.unit != unit) continue;
    if (IsSlip(fit, event))
      as_is += prices[event.axis][TurnsOf(fit, event) - 1];
    else
      other_moves.insert(event.row);
    rows.Take(rows.Column(event.axis, event.row - rows.track().first_row, event.stays),
              -event.step_deg);
  }
  as_is += static_cast<double>(other_moves.size()) * price_of_other;
  TakenSlips taken(&rows, {prices, 1});
  taken.Find();
  constexpr double kRounding = 1e-6;
  if (taken.Cost() >= as_is - kRounding) return std::nullopt;
  return EventsOf(taken.slips(), unit, rows);
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
