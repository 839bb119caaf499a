#include "sim/campaigns/diagnosis/events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

#include "sim/campaigns/diagnosis/angle_errors.h"
#include "sim/campaigns/diagnosis/chances.h"
#include "sim/campaigns/diagnosis/exact_steps.h"

namespace focalfleet::sim {
namespace {

constexpr std::size_t kEventsOfUnitMax = 40;  // events of a unit at once
constexpr int kTurnsMax = 20;
constexpr double kEventLogLikelihood = 25;  // the least of an event that was taken

// ---- Slips near the noise: whole turns of the rotor, against the motion.

// Rows near a jump that belong to its history, the nearest first.
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

// The level of the nearest rows.
double LevelFrom(const std::vector<AngleRow>& rows, const UnitTrack& track, std::size_t at,
                 int step) {
  constexpr std::size_t kNearest = 3;
  std::vector<AngleRow> near = RowsFrom(rows, track, at, step);
  near.resize(std::min(near.size(), kNearest));
  return MedianError(near);
}

// The gain of a step of `size_deg` before row k, on the side of it that gains less, in squares of
// the rows' noise. A row counts for at most kMost. A place that comes back at once was an outlier,
// and a step gains nothing by it on either side.
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
  std::size_t move = 0;  // the move that it happened in
  double size_deg = 0, turns = 0;
  bool whole = false;       // a whole number of turns, against the motion
  bool is_lasting = false;  // the next rows stay at the new level
};

// The longest move between two rows that went the other way; 0: none.
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
    // The step between the two rows, or between the levels on either side where these two rows are
    // noisy.
    for (const double tried :
         {size, LevelFrom(rows, track, k, 1) - LevelFrom(rows, track, k - 1, -1)}) {
      jump.turns = std::round(tried / turn);
      jump.move = MoveAgainst(track, axis, from, to, jump.turns);
      jump.whole = jump.move != 0 && jump.turns != 0 && std::abs(jump.turns) <= kTurnsMax &&
                   std::abs(tried - jump.turns * turn) < 0.25 * turn;
      if (jump.whole) break;
    }
    jump.is_lasting = GainOfStep(rows, track, k, jump.turns * turn, noise_mm) > kGainMin;
    jumps.push_back(jump);
  }
  return jumps;
}

// The noise of a place across the arm, from the differences of most of the unit's rows. Negative
// where there are too few rows.
double UsualNoise_mm(const Fit& fit, std::size_t unit, std::size_t axis) {
  constexpr std::size_t kJumpsMin = 8;
  const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
  const std::vector<AngleRow> rows = AngleErrors(fit, track, axis);
  std::vector<double> jumps;
  for (std::size_t k = 1; k < rows.size(); ++k)
    jumps.push_back(std::abs(rows[k].error_deg - rows[k - 1].error_deg) /
                    std::hypot(rows[k].sigma_deg(1), rows[k - 1].sigma_deg(1)));
  if (jumps.size() < kJumpsMin) return -1;
  return std::max(Median(std::move(jumps)) / 0.6745, 1e-3 * fit.noise.least_um);
}

// Slips of the axis. `noise_mm`: of a place, without slips.
std::vector<EventTerm> Slips(const Fit& fit, std::size_t unit, std::size_t axis, double noise_mm) {
  constexpr double kNoiseMax = 1.0 / 8;  // of a turn: otherwise turns cannot be counted
  std::vector<EventTerm> events;
  if (noise_mm < 0) return events;
  const UnitTrack track = TrackOf(fit.model, *fit.facts, unit);
  const double turn = 360 / track.unit->gear[axis];
  std::vector<AngleRow> rows = AngleErrors(fit, track, axis);
  std::erase_if(rows,
                [&](const AngleRow& row) { return row.sigma_deg(noise_mm) > kNoiseMax * turn; });
  std::vector<Jump> jumped = JumpsOf(rows, track, axis, turn, noise_mm);
  // Many jumps by whole turns against the motion are slips, however close they follow. A jump there
  // and back again counts once, as an outlier does.
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
    if (jump.whole && (many || jump.is_lasting) && events.size() < kEventsOfUnitMax)
      events.push_back({unit, track.first_row + jump.move, axis, true, jump.turns * turn});
  return events;
}

enum class StepKind { kTurns, kCommand, kBlocked };

StepKind KindOf(const Fit& fit, const EventTerm& event) {
  const double step = fit.facts->step_deg[event.axis][event.row];
  if (std::abs(std::abs(event.step_deg) - std::abs(step)) < 1e-9) return StepKind::kCommand;
  const double turns = event.step_deg * fit.model.units[event.unit].gear[event.axis] / 360;
  return std::abs(turns - std::round(turns)) < 1e-6 ? StepKind::kTurns : StepKind::kBlocked;
}

double FleetNoise_mm(const Fit& fit, std::size_t axis) {
  constexpr std::size_t kUnits = 64;  // enough for a median
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
      of_unit[unit] = ExactSteps(*fit, unit, &geometry[unit]);
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

namespace {

bool AnyHasMet(const Fit& fit) {
  return std::ranges::any_of(fit.model.events,
                             [&](const EventTerm& event) { return IsOfContact(fit, event); });
}

// The gap at which arms come to rest that have met. Below any gap where none have met, or where the
// data do not show it. Arms that meet on their way may have targets far apart.
double TouchingGap_mm(const Fit& fit) {
  const FilledColumn* gap = fit.facts->Find(kArmGap);
  std::vector<double> gaps_mm;
  for (const EventTerm& event : fit.model.events)
    if (gap != nullptr && IsOfContact(fit, event)) gaps_mm.push_back(gap->values[event.row]);
  return gaps_mm.empty() ? -1
                         : std::min(Median(std::move(gaps_mm)), kThickestArm * fit.facts->pitch_mm);
}

double SizeOf_um(const Fit& fit, const EventTerm& event) {
  const CampaignUnit& unit = fit.model.units[event.unit];
  const double lever_mm =
      event.axis == kPhi ? unit.arm_mm[kPhi] : std::hypot(unit.arm_mm[0], unit.arm_mm[1]);
  return 1e3 * lever_mm * std::abs(event.step_deg) * std::numbers::pi / 180;
}

CauseFound CauseOfSteps(const Fit& fit, std::string_view name, std::string_view paragraph,
                        const std::vector<EventTerm>& events) {
  CauseFound cause = CauseNamed(name);
  cause.scope = "unit";
  cause.amplitude_unit = kEvents;
  std::set<std::uint32_t> units;
  std::set<std::size_t> axes, moves;  // a lost move has an event of each axis
  double square = 0;
  for (const EventTerm& event : events) {
    moves.insert(event.row);
    units.insert(fit.model.units[event.unit].id);
    axes.insert(event.axis);
    square += std::pow(SizeOf_um(fit, event), 2);
  }
  cause.amplitude = static_cast<double>(moves.size());
  cause.axis = axes.size() > 1 ? "both" : *axes.begin() == kTheta ? "theta" : "phi";
  cause.units.assign(units.begin(), units.end());
  cause.all_units = units.size() == fit.model.units.size();
  cause.ci95[0] = cause.ci95[1] = cause.amplitude;
  cause.size_um = std::sqrt(square / cause.amplitude);
  cause.delta_log_likelihood = kEventLogLikelihood * cause.amplitude;
  cause.paragraph = paragraph;
  return cause;
}

}  // namespace

bool IsOfContact(const Fit& fit, const EventTerm& event) {
  const auto reach = [](const CampaignUnit& unit) {
    return unit.arm_mm[kTheta] + unit.arm_mm[kPhi];
  };
  const StepKind kind = KindOf(fit, event);
  if (kind == StepKind::kCommand) return false;
  const CampaignUnit& own = fit.model.units[event.unit];
  const std::vector<std::uint32_t>& exposure = fit.facts->exposures.of_row;
  // Two units that lost whole turns both slipped.
  const auto has_met = [&](StepKind one, StepKind other) {
    return other != StepKind::kCommand &&
           (one == StepKind::kBlocked || other == StepKind::kBlocked);
  };
  return std::ranges::any_of(fit.model.events, [&](const EventTerm& other) {
    const CampaignUnit& unit = fit.model.units[other.unit];
    return exposure[other.row] == exposure[event.row] && other.unit != event.unit &&
           has_met(kind, KindOf(fit, other)) &&
           std::hypot(unit.base_x_mm - own.base_x_mm, unit.base_y_mm - own.base_y_mm) <
               reach(unit) + reach(own);
  });
}

std::vector<CauseFound> EventCauses(const Fit& fit) {
  struct Named {
    std::string_view name, paragraph;
    std::vector<EventTerm> events;
  };
  Named turns{kStepLoss,
              "The rotor lost its field for whole motor turns: raise the drive, slow down, or look "
              "for what blocks the axis; home the unit.",
              {}};
  Named commands{kLostCommand,
                 "A whole move was not made, or made twice: look at the bus and its error "
                 "counters.",
                 {}};
  Named contacts{kContact,
                 "Two neighbours stopped short of their way in the same move, and stand off since: "
                 "they have touched. Home both, and look at the plan of that move.",
                 {}};
  const bool any_has_met = AnyHasMet(fit);
  // A unit that stopped short alone, where others have met, has pushed its neighbour too little to
  // be seen. Some units that are stopped end whole turns short.
  const double touching_mm = TouchingGap_mm(fit);
  const auto has_met = [&](const EventTerm& event, StepKind kind) {
    if (kind == StepKind::kBlocked) return any_has_met;
    return IsOfContact(fit, event) ||
           (touching_mm >= 0 && fit.facts->Find(kArmGap)->values[event.row] <= touching_mm);
  };
  for (const EventTerm& event : fit.model.events) {
    const StepKind kind = KindOf(fit, event);
    if (kind == StepKind::kCommand) {
      commands.events.push_back(event);
    } else if (has_met(event, kind)) {
      contacts.events.push_back(event);
    } else if (kind == StepKind::kTurns) {
      turns.events.push_back(event);
    }
  }
  std::vector<CauseFound> causes;
  for (const Named* one : {&turns, &commands, &contacts})
    if (!one->events.empty())
      causes.push_back(CauseOfSteps(fit, one->name, one->paragraph, one->events));
  return causes;
}

std::vector<UnknownFound> UnexplainedSteps(const Fit& fit) {
  std::vector<UnknownFound> reported;
  if (AnyHasMet(fit)) return reported;
  for (const EventTerm& event : fit.model.events)
    if (KindOf(fit, event) == StepKind::kBlocked)
      reported.push_back({"unit_id",
                          "unit " + std::to_string(fit.model.units[event.unit].id) +
                              " stands elsewhere since move " +
                              std::to_string(fit.facts->campaign->move_id[event.row]),
                          0, SizeOf_um(fit, event)});
  return reported;
}

}  // namespace focalfleet::sim
