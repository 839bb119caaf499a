#include "sim/campaigns/diagnosis/terms/slips.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <span>
#include <utility>

#include "sim/campaigns/diagnosis/terms/step_rows.h"

namespace focalfleet::sim {
namespace {

// Share of a turn by which a step may lie beside a whole number of turns, either way. Chance passes
// half of all steps. With 0.125 one of nine slips of a unit is taken for one of the other axis;
// with 0.5 every step passes, and steps that are none are taken again and again.
constexpr double kBeside = 0.25;

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

// The prices of slips, and how one is tried.
struct SlipRule {
  const SlipPrices& prices;
  double scale = 1;  // of the prices

  struct AxisScore {
    double b = 0, g = 0;
  };
  // Takes a step of the axis by b / g, in the moves from one to another, if it is a better slip.
  void Try(const StepRows& rows, std::size_t axis, AxisScore score, std::size_t from,
           std::size_t to, Slip* best) const {
    const auto [b, g] = score;
    if (!(g > 0)) return;  // these rows show no step of the axis
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

// The slip that is farthest above its price, by as few rows as show one. A slip before the first
// row that is seen after a homing shows beside the rows before the homing.
Slip BestSlip(const StepRows& rows, const SlipRule& rule) {
  const double least = rule.scale * std::min(std::ranges::min(rule.prices[kTheta]),
                                             std::ranges::min(rule.prices[kPhi]));
  Slip best;
  for (const std::size_t either_side : kEitherSide) {
    for (std::size_t k = 1; k < rows.rows(); ++k) {
      const StepRows::Jump jump = rows.JumpAt(k, either_side, best.above + least);
      for (const std::size_t axis : {kTheta, kPhi})
        rule.Try(rows, axis, {jump.b[axis], jump.g[axis][axis]}, rows.MoveAfterRow(k),
                 rows.move(rows.RowThatShows(axis, k)), &best);
    }
    if (best.move != kNoMove) break;
  }
  return best;
}

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
      prices[axis][k] = std::log(kSureOfStep / (1 - kSureOfStep)) -
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

  /// Takes slips, one after the other, and looks at each once more beside all others: one that few
  /// rows showed may be another one by all.
  void Find() {
    while (slips_.size() < kStepsOfUnitMax) {
      const Slip slip = BestSlip(rows_, rule_);
      if (slip.move == kNoMove) break;
      Add(slip);
    }
    constexpr int kSweeps = 3;
    bool changed = true;
    for (int sweep = 0; changed && sweep < kSweeps; ++sweep) {
      while (DropPair()) {
      }
      changed = Exchange();
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
  [[nodiscard]] Slip BestByAll() {
    // Columns take 32 bytes for each two rows: 32 MB. With half of it units of 750 rows, and with
    // double those of 1500, do without exchanges; steps are then as few rows showed them.
    constexpr std::size_t kRowsMost = 1000;
    if (rows_.rows() > kRowsMost) return {};
    if (before_row_.empty()) LookBeforeRows();
    Slip best;
    for (const BeforeRow& one : before_row_)
      rule_.Try(rows_, one.axis, {one.column.dot(rows_.left()), one.square}, one.from, one.to,
                &best);
    return best;
  }
  // The columns are the same however many slips are taken.
  void LookBeforeRows() {
    for (std::size_t k = 0; k < rows_.rows(); ++k)
      for (const std::size_t axis : {kTheta, kPhi}) {
        Eigen::VectorXd column = rows_.Column(axis, rows_.move(k), true);
        const double square = column.squaredNorm();
        before_row_.push_back({axis, std::move(column), square, rows_.MoveAfterRow(k),
                               rows_.move(rows_.RowThatShows(axis, k))});
      }
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
      if (Cost() < std::min(before, without) - kCostRounding) {
        changed = true;
        continue;
      }
      if (best.move != kNoMove) Remove(slips_.size() - 1);
      if (without < before - kCostRounding)
        changed = true;
      else
        Add(own);
    }
    return changed;
  }
  // Drops two slips of one move that do not pay together. False: there are none.
  bool DropPair() {
    for (std::size_t a = 0; a < slips_.size(); ++a)
      for (std::size_t b = a + 1; b < slips_.size(); ++b) {
        if (slips_[a].move != slips_[b].move) continue;
        const std::vector<Slip> as_is = slips_;
        const double before = Cost();
        const Slip later = Remove(b), earlier = Remove(a);
        if (Cost() < before - kCostRounding) return true;
        Add(earlier), Add(later);
        slips_ = as_is;
      }
    return false;
  }

  // A step before a row, by all rows, and the moves in which it may have been.
  struct BeforeRow {
    std::size_t axis = kTheta;
    Eigen::VectorXd column;
    double square = 0;
    std::size_t from = 0, to = 0;
  };

  StepRows& rows_;
  SlipRule rule_;
  std::vector<Slip> slips_;
  std::vector<BeforeRow> before_row_;
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
  if (taken.Cost() >= as_is - kCostRounding) return std::nullopt;
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
