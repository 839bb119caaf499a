#include "sim/diagnosis/events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>

#include "sim/diagnosis/angle_errors.h"
#include "sim/diagnosis/chances.h"
#include "sim/diagnosis/plain_geometry.h"

namespace focalfleet::sim {
namespace {

constexpr double kRadians = std::numbers::pi / 180;
constexpr std::size_t kEventsMax = 40;  // of a unit at once
constexpr double kStepMin_deg = 0.3;    // a lost command below it cannot be told from other steps
constexpr int kTurnsMax = 20;
constexpr double kEventEvidence = 25;  // at least, of an event that was taken

// ---- lost and doubled commands, and slips: so large that only the exact place tells

constexpr double kCap_mm = 0.5;  // what an outlier costs at most

// One unit's rows, and what has been added to each angle so far.
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

// What may have happened in a move: what it added to the angles.
struct Change {
  std::size_t move = 0;
  double by_deg[2] = {0, 0};
  double gained = 0;
};
enum class ChangeKind { kWholeMove, kSlip };

// A command that was lost, or made twice; or whole turns of a rotor, against its motion.
std::vector<Change> ChangesIn(const UnitTrack& track, std::size_t move, ChangeKind kind) {
  constexpr int kTurnsAtOnce = 4;
  const double steps[2] = {track.step_deg[kTheta][move], track.step_deg[kPhi][move]};
  std::vector<Change> changes;
  if (kind == ChangeKind::kWholeMove) {
    if (std::abs(steps[0]) + std::abs(steps[1]) < kStepMin_deg) return changes;
    for (const double sign : {-1.0, 1.0})
      changes.push_back({move, {sign * steps[0], sign * steps[1]}});
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

// What every row costs now, and all from a row on.
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

// The one that gains most, if it gains `gain_min`.
Change BestChange(const UnitRows& rows, ChangeKind kind, double gain_min) {
  constexpr double kRounding = 1e-9;  // of sums of squares, mm^2
  const Costs costs = CostsOf(rows);
  Change best;
  for (std::size_t move = 0; move < rows.track.moves; ++move) {
    const std::size_t end = EndOfHistory(rows.track, move);
    for (Change& change : ChangesIn(rows.track, move, kind)) {
      const double enough = std::max(best.gained, gain_min) - kRounding;
      double gained = 0;
      // No more can be gained than what the rows to come cost: most moves are out after a few.
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

// Once a change is known, so is the geometry: by the rows before and behind it.
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

// Changes that explain the rows, from one geometry to begin at.
std::vector<Change> FindChanges(ChangeKind kind, std::size_t at_most, double far_mm,
                                const CampaignUnit& table, UnitRows* rows) {
  const double gain_min = 3 * far_mm * far_mm;  // some rows' worth
  std::vector<Change> found;
  while (found.size() < at_most) {
    const Change best = BestChange(*rows, kind, gain_min);
    if (best.gained < gain_min) break;
    const std::size_t end = EndOfHistory(rows->track, best.move);
    for (std::size_t i = best.move; i < end; ++i)
      for (const std::size_t axis : {kTheta, kPhi}) rows->added_deg[axis][i] += best.by_deg[axis];
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

// One way to explain a unit's rows that lie far off.
struct Explained {
  std::vector<Change> changes;
  CampaignUnit geometry;  // that they belong to
  double cost = 0;        // that is left
  std::size_t far = 0;    // rows that are
};

Explained ExplainedBy(ChangeKind kind, std::size_t at_most, const Fit& fit, std::size_t unit,
                      const CampaignUnit& geometry, double far_mm) {
  UnitRows rows = RowsOf(fit, unit, geometry);
  Explained out{
      .changes = FindChanges(kind, at_most, far_mm, fit.facts->campaign->units[unit], &rows),
      .geometry = rows.geometry};
  out.cost = TotalCost(rows);
  for (std::size_t i = 0; i < rows.track.moves; ++i)
    if (fit.aside[rows.track.first_row + i] == 0 &&
        RowCost(rows, i, rows.added_deg[kTheta][i], rows.added_deg[kPhi][i]) > far_mm * far_mm)
      ++out.far;
  return out;
}

// The unit's lost and doubled commands, or else its slips, where these are far larger than noise;
// its geometry is set to the one that they belong to, as a fit that did not know of them may have
// been dragged along.
std::vector<EventTerm> ExactEvents(const Fit& fit, std::size_t unit, CampaignUnit* geometry) {
  constexpr double kLeftMax = 0.2;          // what changes do not explain is something else
  constexpr std::size_t kRowsForASlip = 4;  // that were far, at least: slips fit anything
  // A row is worth a look that noise does not put there. What is sought here makes a unit noisy.
  const double factor = std::min(fit.noise.unit_factor[unit], 1.5);
  const double far_mm = std::clamp(10e-3 * fit.noise.place_um * factor, 0.04, 0.4);
  const CampaignUnit& fitted = fit.model.units[unit];
  const UnitRows rows = RowsOf(fit, unit, fitted);
  std::size_t far = 0;
  for (std::size_t i = 0; i < rows.track.moves; ++i)
    if (fit.aside[rows.track.first_row + i] == 0 && RowCost(rows, i, 0, 0) > far_mm * far_mm) ++far;
  if (far == 0) return {};
  const double before = TotalCost(rows);
  // Far rows may still be noise's, of rests that all units have; beside changes that explain far
  // more than noise does, what all rows cost tells.
  const auto seen = static_cast<double>(
      std::ranges::count_if(rows.x_mm, [](double x) { return std::isfinite(x); }));
  const double of_noise = 2 * seen * std::pow(1e-3 * fit.noise.typical_um * factor, 2);
  const auto explains = [&](const Explained& one) {
    const bool large = std::ranges::all_of(
        one.changes, [](const Change& change) { return change.gained >= 0.9 * kCap_mm * kCap_mm; });
    return static_cast<double>(one.far) <= kLeftMax * static_cast<double>(far) ||
           (large && before > of_noise && one.cost - of_noise <= kLeftMax * (before - of_noise));
  };
  std::optional<Explained> best;
  for (const ChangeKind kind : {ChangeKind::kWholeMove, ChangeKind::kSlip}) {
    const std::size_t at_most =
        kind == ChangeKind::kSlip ? std::min(far / kRowsForASlip, kEventsMax) : kEventsMax;
    for (const CampaignUnit& from : {fitted, fit.facts->campaign->units[unit]}) {
      Explained one = ExplainedBy(kind, at_most, fit, unit, from, far_mm);
      if (one.changes.empty() || one.cost >= before || !explains(one)) continue;
      if (!best || one.cost < best->cost) best = std::move(one);
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

// ---- slips near the noise: whole turns of the rotor, against the motion

// Rows about a jump that belong to its history, the nearest first.
std::vector<AngleRow> RowsFrom(const std::vector<AngleRow>& rows, const UnitTrack& track,
                               std::size_t at, int step) {
  constexpr std::size_t kRows = 8;
  std::vector<AngleRow> near;
  for (std::size_t k = at; k < rows.size() && near.size() < kRows;
       k += static_cast<std::size_t>(step)) {
    near.push_back(rows[k]);
    if (step < 0 && (k == 0 || track.restarts[rows[k].move] != 0)) break;
    if (step > 0 && k + 1 < rows.size() && EndOfHistory(track, rows[k].move) <= rows[k + 1].move)
      break;
  }
  return near;
}

double MedianError(const std::vector<AngleRow>& rows) {
  std::vector<double> errors;
  for (const AngleRow& row : rows) errors.push_back(row.error_deg);
  return Median(std::move(errors));
}

// Where the nearest rows stand.
double LevelFrom(const std::vector<AngleRow>& rows, const UnitTrack& track, std::size_t at,
                 int step) {
  constexpr std::size_t kNearest = 3;
  std::vector<AngleRow> near = RowsFrom(rows, track, at, step);
  near.resize(std::min(near.size(), kNearest));
  return MedianError(near);
}

// What a step of `size_deg` before row k explains of the rows on its poorer side, in squares of
// their noise. A row pays for at most kMost: a place that comes back at once was an outlier, and
// pays nothing, on whichever side it lies.
double GainOfStep(const std::vector<AngleRow>& rows, const UnitTrack& track, std::size_t k,
                  double size_deg, double noise_mm) {
  constexpr double kMost = 25;
  const std::vector<AngleRow> before = RowsFrom(rows, track, k - 1, -1);
  const std::vector<AngleRow> behind = RowsFrom(rows, track, k, 1);
  const auto cost = [&](const AngleRow& row, double level) {
    const double off = (row.error_deg - level) / row.sigma_deg(noise_mm);
    return std::min(off * off, kMost);
  };
  const auto gain = [&](const std::vector<AngleRow>& side, double level, double step) {
    double sum = 0;
    for (const AngleRow& row : side) sum += cost(row, level) - cost(row, level + step);
    return sum;
  };
  return std::min(gain(behind, MedianError(before), size_deg),
                  gain(before, MedianError(behind), -size_deg));
}

struct Jump {
  std::size_t move = 0;  // that it happened in
  double size_deg = 0, turns = 0;
  bool whole = false;  // a whole number of turns, against the motion
  bool holds = false;  // the next rows stand at the new level
};

// The move between two rows that went the other way, the longest; 0: none.
std::size_t MoveAgainst(const UnitTrack& track, std::size_t axis, std::size_t from, std::size_t to,
                        double turns) {
  std::size_t best = 0;
  double most = 0;
  for (std::size_t move = from + 1; move <= to; ++move) {
    const double step = track.step_deg[axis][move];
    if (step * turns < 0 && std::abs(step) > most) most = std::abs(step), best = move;
  }
  return best;
}

std::vector<Jump> JumpsOf(const std::vector<AngleRow>& rows, const UnitTrack& track,
                          std::size_t axis, double turn, double noise_mm) {
  constexpr double kGainMin = 60;  // three rows at least
  std::vector<Jump> jumps;
  for (std::size_t k = 1; k < rows.size(); ++k) {
    const std::size_t from = rows[k - 1].move, to = rows[k].move;
    const double size = rows[k].error_deg - rows[k - 1].error_deg;
    if (EndOfHistory(track, from) <= to || std::abs(size) < 0.6 * turn) continue;
    Jump jump;
    jump.size_deg = size;
    // Of the two rows, or of what stands on either side where these two are noisy.
    for (const double tried :
         {size, LevelFrom(rows, track, k, 1) - LevelFrom(rows, track, k - 1, -1)}) {
      jump.turns = std::round(tried / turn);
      jump.move = MoveAgainst(track, axis, from, to, jump.turns);
      jump.whole = jump.move != 0 && jump.turns != 0 && std::abs(jump.turns) <= kTurnsMax &&
                   std::abs(tried - jump.turns * turn) < 0.25 * turn;
      if (jump.whole) break;
    }
    jump.holds = GainOfStep(rows, track, k, jump.turns * turn, noise_mm) > kGainMin;
    jumps.push_back(jump);
  }
  return jumps;
}

// Of a place across the arm, as the differences of most of the unit's rows have it; negative: too
// few rows.
double UsualNoise_mm(const Fit& fit, std::size_t unit, std::size_t axis) {
  constexpr std::size_t kJumpsMin = 8;
  const UnitTrack track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
  const std::vector<AngleRow> rows = AngleErrors(fit, track, axis);
  std::vector<double> jumps;
  for (std::size_t k = 1; k < rows.size(); ++k)
    jumps.push_back(std::abs(rows[k].error_deg - rows[k - 1].error_deg) /
                    std::hypot(rows[k].sigma_deg(1), rows[k - 1].sigma_deg(1)));
  return jumps.size() < kJumpsMin ? -1 : Median(std::move(jumps)) / 0.6745;
}

// `noise_mm`: of a place, without slips.
std::vector<EventTerm> Slips(const Fit& fit, std::size_t unit, std::size_t axis, double noise_mm) {
  constexpr double kNoiseMax = 1.0 / 8;  // of a turn: else turns cannot be counted
  std::vector<EventTerm> events;
  if (noise_mm < 0) return events;
  const UnitTrack track = MakeTrack(*fit.facts, unit, fit.model.units[unit]);
  const double turn = 360 / track.unit->gear[axis];
  std::vector<AngleRow> rows = AngleErrors(fit, track, axis);
  std::erase_if(rows,
                [&](const AngleRow& row) { return row.sigma_deg(noise_mm) > kNoiseMax * turn; });
  std::vector<Jump> jumped = JumpsOf(rows, track, axis, turn, noise_mm);
  // Many jumps that are whole turns against the motion: slips, however close they follow. There and
  // back again counts once: so does an outlier.
  double whole = 0, all = 0;
  for (std::size_t k = 0; k < jumped.size(); ++k) {
    const auto undoes = [&](std::size_t other) {
      return std::abs(jumped[k].size_deg + jumped[other].size_deg) < 0.3 * turn;
    };
    const bool returns = (k > 0 && undoes(k - 1)) || (k + 1 < jumped.size() && undoes(k + 1));
    const double weight = returns ? 0.5 : 1;
    all += weight;
    if (jumped[k].whole) whole += weight;
  }
  const bool many = whole >= 4 && whole >= 0.8 * all;
  for (const Jump& jump : jumped)
    if (jump.whole && (many || jump.holds) && events.size() < kEventsMax)
      events.push_back({unit, track.first_row + jump.move, axis, true, jump.turns * turn});
  return events;
}

bool IsLostCommand(const Fit& fit, const EventTerm& event) {
  const double step = fit.facts->step_deg[event.axis][event.row];
  return std::abs(std::abs(event.step_deg) - std::abs(step)) < 1e-9;
}

double FleetNoise_mm(const Fit& fit, std::size_t axis) {
  constexpr std::size_t kUnits = 64;  // are enough for a median
  const std::size_t units = fit.model.units.size();
  std::vector<double> usual;
  for (std::size_t unit = 0; unit < units; unit += std::max<std::size_t>(1, units / kUnits))
    if (const double noise = UsualNoise_mm(fit, unit, axis); noise >= 0) usual.push_back(noise);
  return usual.empty() ? -1 : Median(std::move(usual));
}

}  // namespace

std::size_t AddEvents(Fit* fit) {
  const std::size_t units = fit->model.units.size();
  std::vector<std::vector<EventTerm>> of_unit(units);
  std::vector<CampaignUnit> geometry = fit->model.units;
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  const auto take = [&] {
    std::size_t added = 0;
    for (auto& events : of_unit) {
      for (const EventTerm& event : events) fit->model.events.push_back(event), ++added;
      events.clear();
    }
    if (added == 0) return added;
    fit->model.units = geometry;
    UpdateResiduals(fit);
    SettleFit(fit, 3);
    return added;
  };
  fit->parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      of_unit[unit] = ExactEvents(*fit, unit, &geometry[unit]);
  });
  std::size_t added = take();
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    geometry = fit->model.units;
    const std::array<double, 2> usual = {FleetNoise_mm(*fit, kTheta), FleetNoise_mm(*fit, kPhi)};
    fit->parallel(chunks.size(), [&](std::size_t chunk) {
      for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
        for (const std::size_t axis : {kTheta, kPhi})
          for (const EventTerm& slip : Slips(*fit, unit, axis, usual[axis]))
            of_unit[unit].push_back(slip);
    });
    const std::size_t slips = take();
    added += slips;
    if (slips == 0) break;
  }
  return added;
}

std::vector<CauseFound> EventCauses(const Fit& fit) {
  std::vector<CauseFound> causes;
  for (const bool lost_command : {false, true}) {
    CauseFound cause = CauseNamed(lost_command ? kLostCommand : kStepLoss);
    cause.scope = "unit";
    cause.amplitude_unit = "events";
    std::set<std::uint32_t> units;
    std::set<std::size_t> axes;
    std::set<std::size_t> moves;  // a lost one has an event of each axis
    double square = 0;
    for (const EventTerm& event : fit.model.events) {
      if (IsLostCommand(fit, event) != lost_command) continue;
      moves.insert(event.row);
      const CampaignUnit& unit = fit.model.units[event.unit];
      units.insert(unit.id);
      axes.insert(event.axis);
      const double lever_mm =
          event.axis == kPhi ? unit.arm_mm[kPhi] : std::hypot(unit.arm_mm[0], unit.arm_mm[1]);
      square += std::pow(1e3 * lever_mm * event.step_deg * std::numbers::pi / 180, 2);
    }
    if (moves.empty()) continue;
    cause.amplitude = static_cast<double>(moves.size());
    cause.axis = axes.size() > 1 ? "both" : *axes.begin() == kTheta ? "theta" : "phi";
    cause.units.assign(units.begin(), units.end());
    cause.all_units = units.size() == fit.model.units.size();
    cause.ci95[0] = cause.ci95[1] = cause.amplitude;
    cause.size_um = std::sqrt(square / cause.amplitude);
    cause.delta_log_likelihood = kEventEvidence * cause.amplitude;
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
