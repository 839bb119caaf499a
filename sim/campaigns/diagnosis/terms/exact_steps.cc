#include "sim/campaigns/diagnosis/terms/exact_steps.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"
#include "sim/campaigns/diagnosis/terms/step_rows.h"

namespace focalfleet::sim {
namespace {

// A smaller lost command cannot be distinguished from other steps.
constexpr double kStepMin_deg = 0.3;
constexpr double kRowsWorth = 3;  // far rows that a change has to put right
constexpr double kCap_mm = 0.5;   // the most that an outlier costs

// The rows of a unit, and the angles that changes have added so far.
struct UnitRows {
  CampaignUnit geometry;
  UnitTrack track;
  std::span<const double> x_mm, y_mm;
  std::vector<double> added_deg[2];
};

double RowCost(const UnitRows& rows, std::size_t i, double theta_deg, double phi_deg) {
  if (!std::isfinite(rows.x_mm[i])) return 0;
  const PlacePoint at = PlaceOf(rows.geometry, rows.track.cmd_deg[kTheta][i] + theta_deg,
                                rows.track.cmd_deg[kPhi][i] + phi_deg);
  const double x = rows.x_mm[i] - at.x_mm, y = rows.y_mm[i] - at.y_mm;
  return std::min(x * x + y * y, kCap_mm * kCap_mm);
}

double TotalCost(const UnitRows& rows) {
  double sum = 0;
  for (std::size_t i = 0; i < rows.track.moves; ++i)
    sum += RowCost(rows, i, rows.added_deg[kTheta][i], rows.added_deg[kPhi][i]);
  return sum;
}

// A change that may have happened in a move: the angles that it added.
struct Change {
  std::size_t move = 0;
  double by_deg[2] = {0, 0};
  double gained = 0;
};
// kInOrder finds whole moves, each by the rows that follow next rather than by all later rows.
enum class ChangeKind { kWholeMove, kInOrder, kSlip, kBlocked };

// The difference of both axes from their commands, by the place alone. NaN where the place is out
// of reach.
struct AnglesOff {
  double deg[2];
};
AnglesOff AnglesOffAt(const UnitRows& rows, std::size_t i) {
  const CampaignUnit& unit = rows.geometry;
  const double a = unit.arm_mm[kTheta], b = unit.arm_mm[kPhi];
  const double x = rows.x_mm[i] - unit.base_x_mm, y = rows.y_mm[i] - unit.base_y_mm;
  const double cosine = (x * x + y * y - a * a - b * b) / (2 * a * b);
  constexpr double kFlat = 0.9;  // cosine: nearly stretched or folded arms do not separate the axes
  AnglesOff best{{std::nan(""), std::nan("")}};
  if (!(std::abs(cosine) < kFlat)) return best;
  double least = std::numeric_limits<double>::infinity();
  for (const double side : {1.0, -1.0}) {
    const double phi = side * std::acos(std::clamp(cosine, -1.0, 1.0));
    const double theta = std::atan2(y, x) - std::atan2(b * std::sin(phi), a + b * std::cos(phi));
    const double off[2] = {
        std::remainder(
            theta / kRadiansPerDegree - unit.zero_deg[kTheta] - rows.track.cmd_deg[kTheta][i], 360),
        std::remainder(phi / kRadiansPerDegree - unit.zero_deg[kPhi] - rows.track.cmd_deg[kPhi][i],
                       360)};
    const double far = std::abs(off[0]) + std::abs(off[1]);
    if (far < least) least = far, best = {{off[0], off[1]}};
  }
  return best;
}

// The angle by which the rows from this move on are off: an obstacle kept the axes from their way.
// An axis that was moving stops short. An axis that was not may have been pushed.
std::vector<Change> StoppedShort(const UnitRows& rows, std::size_t move) {
  constexpr std::size_t kRowsMin = 4, kRowsMax = 60;
  constexpr double kLeast_deg = 0.1;
  std::vector<double> off[2];
  const std::size_t end = EndOfStep(rows.track, move);
  for (std::size_t i = move; i < end && off[0].size() < kRowsMax; ++i) {
    if (!std::isfinite(rows.x_mm[i])) continue;
    const AnglesOff at = AnglesOffAt(rows, i);
    for (const std::size_t axis : {kTheta, kPhi})
      if (std::isfinite(at.deg[axis]))
        off[axis].push_back(std::remainder(at.deg[axis] - rows.added_deg[axis][i], 360));
  }
  if (off[0].size() < kRowsMin) return {};
  Change change{.move = move};
  for (const std::size_t axis : {kTheta, kPhi}) {
    const double by = Median(std::move(off[axis])), step = rows.track.step_deg[axis][move];
    if (std::abs(by) < kLeast_deg) continue;
    if (step != 0 && (by * step > 0 || std::abs(by) > std::abs(step))) return {};
    change.by_deg[axis] = by;
  }
  if (change.by_deg[kTheta] == 0 && change.by_deg[kPhi] == 0) return {};
  return {change};
}

// The changes that may have happened in a move. They are a command that was lost or made twice, of
// both axes or of one, or whole turns of a rotor against its motion.
std::vector<Change> ChangesIn(const UnitRows& rows, std::size_t move, ChangeKind kind) {
  constexpr int kTurnsAtOnce = 4;
  if (kind == ChangeKind::kBlocked) return StoppedShort(rows, move);
  const UnitTrack& track = rows.track;
  const double steps[2] = {track.step_deg[kTheta][move], track.step_deg[kPhi][move]};
  std::vector<Change> changes;
  if (kind == ChangeKind::kWholeMove || kind == ChangeKind::kInOrder) {
    if (std::abs(steps[0]) + std::abs(steps[1]) < kStepMin_deg) return changes;
    for (const double sign : {-1.0, 1.0}) {
      changes.push_back({move, {sign * steps[0], sign * steps[1]}});
      if (steps[0] == 0 || steps[1] == 0) continue;
      changes.push_back({move, {sign * steps[0], 0}});
      changes.push_back({move, {0, sign * steps[1]}});
    }
    return changes;
  }
  for (const std::size_t axis : {kTheta, kPhi})
    for (int turns = 1; steps[axis] != 0 && turns <= kTurnsAtOnce; ++turns) {
      Change slip{.move = move};
      slip.by_deg[axis] = std::copysign(turns * 360 / track.unit->gear[axis], -steps[axis]);
      changes.push_back(slip);
    }
  return changes;
}

// The present cost of each row, and the sum from each row on.
struct Costs {
  std::vector<double> of_row, from;
};
Costs CostsOf(const UnitRows& rows) {
  const std::size_t moves = rows.track.moves;
  Costs costs{std::vector<double>(moves), std::vector<double>(moves + 1, 0)};
  for (std::size_t i = moves; i-- > 0;) {
    costs.of_row[i] = RowCost(rows, i, rows.added_deg[kTheta][i], rows.added_deg[kPhi][i]);
    costs.from[i] = costs.from[i + 1] + costs.of_row[i];
  }
  return costs;
}

// The change that gains most, if it gains `gain_min`.
Change BestChange(const UnitRows& rows, ChangeKind kind, double gain_min) {
  constexpr double kRounding = 1e-9;  // of sums of squares, mm^2
  const Costs costs = CostsOf(rows);
  Change best;
  for (std::size_t move = 0; move < rows.track.moves; ++move) {
    const std::size_t end = EndOfStep(rows.track, move);
    for (Change& change : ChangesIn(rows, move, kind)) {
      const double enough = std::max(best.gained, gain_min) - kRounding;
      double gained = 0;
      // A change cannot gain more than the later rows cost: most moves are excluded after a few
      // rows.
      for (std::size_t i = move; i < end && gained + costs.from[i] - costs.from[end] >= enough; ++i)
        gained +=
            costs.of_row[i] - RowCost(rows, i, rows.added_deg[kTheta][i] + change.by_deg[kTheta],
                                      rows.added_deg[kPhi][i] + change.by_deg[kPhi]);
      if (gained <= best.gained || gained < enough) continue;
      best = change;
      best.gained = gained;
    }
  }
  return best;
}

// A known change makes the geometry known: it is fitted by the rows before and after.
void FitGeometry(const CampaignUnit& table, UnitRows* rows) {
  constexpr int kRounds = 20;
  std::vector<PlainRow> plain;
  for (std::size_t i = 0; i < rows->track.moves; ++i)
    if (std::isfinite(rows->x_mm[i]))
      plain.push_back({rows->track.cmd_deg[kTheta][i] + rows->added_deg[kTheta][i],
                       rows->track.cmd_deg[kPhi][i] + rows->added_deg[kPhi][i], rows->x_mm[i],
                       rows->y_mm[i]});
  rows->geometry = FitPlain(plain, table, rows->geometry, kRounds);
}

// Applies the change from its move on, until the unit is homed.
void Take(const Change& change, UnitRows* rows) {
  const std::size_t end = EndOfStep(rows->track, change.move);
  for (std::size_t i = change.move; i < end; ++i)
    for (const std::size_t axis : {kTheta, kPhi}) rows->added_deg[axis][i] += change.by_deg[axis];
}

bool IsFar(const UnitRows& rows, std::size_t i, const double by_deg[2], double far_mm) {
  return RowCost(rows, i, rows.added_deg[kTheta][i] + by_deg[kTheta],
                 rows.added_deg[kPhi][i] + by_deg[kPhi]) > far_mm * far_mm;
}

// The change before row `at` that brings the most rows near from there on, one after the other.
Change LongestRun(const UnitRows& rows, std::size_t since, std::size_t at, double far_mm) {
  Change best;
  std::size_t longest = 0;
  const std::size_t end = EndOfStep(rows.track, at);
  for (std::size_t move = since; move <= at; ++move) {
    if (EndOfStep(rows.track, move) != end) continue;  // a homing has undone it
    for (const Change& change : ChangesIn(rows, move, ChangeKind::kInOrder)) {
      std::size_t run = 0;
      for (std::size_t i = at; i < end; ++i) {
        if (!std::isfinite(rows.x_mm[i])) continue;
        if (IsFar(rows, i, change.by_deg, far_mm)) break;
        ++run;
      }
      if (run > longest) longest = run, best = change;
    }
  }
  std::size_t left = longest;
  for (std::size_t i = at; left > 0; ++i) {
    if (!std::isfinite(rows.x_mm[i])) continue;
    best.gained += RowCost(rows, i, rows.added_deg[kTheta][i], rows.added_deg[kPhi][i]) -
                   RowCost(rows, i, rows.added_deg[kTheta][i] + best.by_deg[kTheta],
                           rows.added_deg[kPhi][i] + best.by_deg[kPhi]);
    --left;
  }
  return best;
}

// Whole moves in the order of time. After many lost moves no single one explains all later rows,
// but each explains the next ones.
std::vector<Change> FindInOrder(std::size_t at_most, double far_mm, const CampaignUnit& table,
                                UnitRows* rows) {
  constexpr double kNothing[2] = {0, 0};
  const double gain_min = kRowsWorth * far_mm * far_mm;
  std::vector<Change> found;
  std::size_t since = 0;  // after the last row that was where it should be
  for (std::size_t i = 0; i < rows->track.moves && found.size() < at_most; ++i) {
    if (!std::isfinite(rows->x_mm[i])) continue;
    if (IsFar(*rows, i, kNothing, far_mm)) {
      const Change best = LongestRun(*rows, since, i, far_mm);
      if (best.gained < gain_min) continue;  // an outlier: off in this row only
      Take(best, rows);
      found.push_back(best);
    }
    since = i + 1;
  }
  if (!found.empty()) FitGeometry(table, rows);  // not earlier: most rows may still follow
  return found;
}

// Changes that explain the rows, starting from one geometry.
std::vector<Change> FindChanges(ChangeKind kind, std::size_t at_most, double far_mm,
                                const CampaignUnit& table, UnitRows* rows) {
  const double gain_min = kRowsWorth * far_mm * far_mm;
  std::vector<Change> found;
  while (found.size() < at_most) {
    const Change best = BestChange(*rows, kind, gain_min);
    if (best.gained < gain_min) break;
    Take(best, rows);
    FitGeometry(table, rows);
    found.push_back(best);
  }
  return found;
}

UnitRows RowsOf(const Fit& fit, std::size_t unit, const CampaignUnit& geometry) {
  const Campaign& campaign = *fit.facts->campaign;
  UnitRows rows;
  rows.geometry = geometry;
  rows.track = MakeTrack(*fit.facts, unit, geometry);
  rows.x_mm = std::span(campaign.x_mm).subspan(rows.track.first_row, rows.track.moves);
  rows.y_mm = std::span(campaign.y_mm).subspan(rows.track.first_row, rows.track.moves);
  for (const std::size_t axis : {kTheta, kPhi}) rows.added_deg[axis].assign(rows.track.moves, 0);
  return rows;
}

// An explanation of a unit's rows that are far off.
struct Explained {
  std::vector<Change> changes;
  CampaignUnit geometry;  // the geometry of these rows
  double cost = 0;        // the cost that is left
  std::size_t far = 0;    // rows that are still far
};

Explained ExplainedBy(ChangeKind kind, std::size_t at_most, const Fit& fit, std::size_t unit,
                      const CampaignUnit& geometry, double far_mm) {
  const CampaignUnit& table = fit.facts->campaign->units[unit];
  UnitRows rows = RowsOf(fit, unit, geometry);
  Explained out{.changes = kind == ChangeKind::kInOrder
                               ? FindInOrder(at_most, far_mm, table, &rows)
                               : FindChanges(kind, at_most, far_mm, table, &rows),
                .geometry = rows.geometry};
  out.cost = TotalCost(rows);
  for (std::size_t i = 0; i < rows.track.moves; ++i)
    if (fit.aside[rows.track.first_row + i] == 0 &&
        RowCost(rows, i, rows.added_deg[kTheta][i], rows.added_deg[kPhi][i]) > far_mm * far_mm)
      ++out.far;
  return out;
}

}  // namespace

std::vector<EventTerm> ExactSteps(const Fit& fit, std::size_t unit, CampaignUnit* geometry) {
  constexpr double kLeftMax = 0.2;     // more unexplained cost is another effect
  constexpr double kLeftOfAny = 0.05;  // for changes of any size: a drift is not made of steps
  constexpr std::size_t kUnitsForNoise = 4;  // the noise of a single unit may be the drift itself
  constexpr std::size_t kRowsForASlip = 4;   // far rows, at least: slips fit anything
  // A row is tested where noise does not explain it. The steps that are sought make a unit noisy.
  const double factor = std::min(fit.noise.unit_factor[unit], 1.5);
  const double far_mm = std::clamp(10e-3 * fit.noise.place_um * factor, 0.04, 0.4);
  const CampaignUnit& fitted = fit.model.units[unit];
  const UnitRows rows = RowsOf(fit, unit, fitted);
  std::size_t far = 0;
  for (std::size_t i = 0; i < rows.track.moves; ++i)
    if (fit.aside[rows.track.first_row + i] == 0 && RowCost(rows, i, 0, 0) > far_mm * far_mm) ++far;
  if (far == 0) return {};
  const double before = TotalCost(rows);
  // Far rows may still be noise of rests that all units have. The total cost of all rows decides,
  // where the changes explain far more than noise does.
  const auto seen = static_cast<double>(
      std::ranges::count_if(rows.x_mm, [](double x) { return std::isfinite(x); }));
  const double of_noise = 2 * seen * std::pow(1e-3 * fit.noise.typical_um * factor, 2);
  const auto explains = [&](const Explained& one, ChangeKind kind) {
    const bool large = std::ranges::all_of(
        one.changes, [](const Change& change) { return change.gained >= 0.9 * kCap_mm * kCap_mm; });
    const double left = before > of_noise ? (one.cost - of_noise) / (before - of_noise) : 1;
    const bool noise_is_known = fit.model.units.size() >= kUnitsForNoise;
    if (kind == ChangeKind::kBlocked && noise_is_known && left > kLeftOfAny) return false;
    return static_cast<double>(one.far) <= kLeftMax * static_cast<double>(far) ||
           (large && left <= kLeftMax);
  };
  std::optional<Explained> best;
  ChangeKind best_kind = ChangeKind::kWholeMove;
  for (const ChangeKind kind :
       {ChangeKind::kWholeMove, ChangeKind::kInOrder, ChangeKind::kSlip, ChangeKind::kBlocked}) {
    // A change whose size physics gives precedes one of any size, unless it leaves far more.
    const double far_better = kind == ChangeKind::kBlocked ? 0.5 : 1;
    const bool is_whole = kind == ChangeKind::kWholeMove || kind == ChangeKind::kInOrder;
    const std::size_t at_most =
        is_whole ? kStepsOfUnitMax : std::min(far / kRowsForASlip, kStepsOfUnitMax);
    for (const CampaignUnit& from : {fitted, fit.facts->campaign->units[unit]}) {
      Explained one = ExplainedBy(kind, at_most, fit, unit, from, far_mm);
      if (one.changes.empty() || one.cost >= before || !explains(one, kind)) continue;
      const double least = best ? (best_kind == kind ? 1 : far_better) * (best->cost + of_noise)
                                : std::numeric_limits<double>::infinity();
      if (one.cost + of_noise < least) best = std::move(one), best_kind = kind;
    }
  }
  if (!best) return {};
  *geometry = best->geometry;
  std::vector<EventTerm> events;
  for (const Change& change : best->changes)
    for (const std::size_t axis : {kTheta, kPhi})
      if (change.by_deg[axis] != 0)
        events.push_back(
            {unit, rows.track.first_row + change.move, axis, true, change.by_deg[axis]});
  return events;
}

}  // namespace focalfleet::sim
