#include "sim/campaigns/diagnosis/terms/lost_moves.h"

#include <array>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "sim/campaigns/diagnosis/terms/step_rows.h"

namespace focalfleet::sim {
namespace {

struct LostMove {
  std::size_t move = kNoMove;
  double above = 0;  // the price, in ln of the likelihood ratio
};

// The lost move that is farthest above the price, by as few rows as show one.
LostMove BestLostMove(const StepRows& rows, double price) {
  LostMove best;
  const UnitTrack& track = rows.track();
  for (const std::size_t either_side : kEitherSide) {
    for (std::size_t k = 1; k < rows.rows(); ++k) {
      const StepRows::Jump jump = rows.JumpAt(k, either_side, best.above + price);
      for (std::size_t move = rows.MoveAfterRow(k); move <= rows.move(k); ++move) {
        const double by[2] = {-track.step_deg[kTheta][move], -track.step_deg[kPhi][move]};
        double log_ratio = 0;
        for (const std::size_t a : {kTheta, kPhi}) {
          log_ratio += by[a] * jump.b[a];
          for (const std::size_t b : {kTheta, kPhi}) log_ratio -= by[a] * jump.g[a][b] * by[b] / 2;
        }
        if (log_ratio - price > best.above) best = {move, log_ratio - price};
      }
    }
    if (best.move != kNoMove) break;
  }
  return best;
}

// Takes lost moves, one after the other.
std::vector<EventTerm> TakeLostMoves(std::size_t unit, double price, StepRows* rows) {
  std::vector<EventTerm> events;
  std::set<std::size_t> moves;
  while (moves.size() < kStepsOfUnitMax) {
    const LostMove lost = BestLostMove(*rows, price);
    if (lost.move == kNoMove || !moves.insert(lost.move).second) break;
    for (const std::size_t axis : {kTheta, kPhi}) {
      const double by_deg = -rows->track().step_deg[axis][lost.move];
      if (by_deg == 0) continue;
      rows->Take(rows->Column(axis, lost.move, true), by_deg);
      events.push_back({unit, rows->track().first_row + lost.move, axis, true, by_deg});
    }
  }
  return events;
}

}  // namespace

bool IsCommand(const Fit& fit, const EventTerm& event) {
  const double step_deg = fit.facts->step_deg[event.axis][event.row];
  return std::abs(std::abs(event.step_deg) - std::abs(step_deg)) < 1e-9;
}

double PriceOfLostMove(const Fit& fit, std::size_t known) {
  const auto moves = static_cast<double>(fit.facts->campaign->rows());
  const double rate = (static_cast<double>(known) + 0.5) / (moves + 1);  // of Jeffreys' posterior
  return std::log(kSureOfStep / (1 - kSureOfStep)) - std::log(rate) +
         std::log(static_cast<double>(kEitherSide.size()));
}

std::vector<EventTerm> FindLostMoves(const Fit& fit, std::size_t unit, double price) {
  if (!fit.UsesUnit(unit)) return {};
  StepRows rows(fit, unit);
  return TakeLostMoves(unit, price, &rows);
}

std::optional<std::vector<EventTerm>> LostMovesAnew(const Fit& fit, std::size_t unit, double price,
                                                    double price_of_other) {
  if (!fit.UsesUnit(unit)) return std::nullopt;
  StepRows rows(fit, unit);
  double as_is = rows.left().squaredNorm() / 2;
  std::map<std::size_t, std::array<double, 2>> by_row;
  for (const EventTerm& event : fit.model.events) {
    if (event.unit != unit) continue;
    by_row[event.row][event.axis] += event.step_deg;
    rows.Take(rows.Column(event.axis, event.row - rows.track().first_row, event.stays),
              -event.step_deg);
  }
  if (by_row.empty()) return std::nullopt;
  for (const auto& [row, by_deg] : by_row) {
    const bool is_lost = by_deg[kTheta] == -fit.facts->step_deg[kTheta][row] &&
                         by_deg[kPhi] == -fit.facts->step_deg[kPhi][row];
    as_is += is_lost ? price : price_of_other;
  }
  std::vector<EventTerm> lost = TakeLostMoves(unit, price, &rows);
  std::set<std::size_t> moves;
  for (const EventTerm& event : lost) moves.insert(event.row);
  const double anew = rows.left().squaredNorm() / 2 + price * static_cast<double>(moves.size());
  if (anew >= as_is - kCostRounding) return std::nullopt;
  return lost;
}

}  // namespace focalfleet::sim
