#include "sim/campaigns/diagnosis/terms/events.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>
#include <span>
#include <utility>

#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/terms/exact_steps.h"
#include "sim/campaigns/diagnosis/terms/lost_moves.h"
#include "sim/campaigns/diagnosis/terms/slips.h"

namespace focalfleet::sim {
namespace {

enum class StepKind { kTurns, kCommand, kBlocked };

StepKind KindOf(const Fit& fit, const EventTerm& event) {
  if (IsCommand(fit, event)) return StepKind::kCommand;
  return IsSlip(fit, event) ? StepKind::kTurns : StepKind::kBlocked;
}

// Steps of the model that are slips, of all units.
std::vector<EventTerm> SlipsOf(const Fit& fit) {
  std::vector<EventTerm> slips;
  for (const EventTerm& event : fit.model.events)
    if (KindOf(fit, event) == StepKind::kTurns) slips.push_back(event);
  return slips;
}

// Moves that were not made.
std::size_t LostMovesOf(const Fit& fit) {
  std::set<std::size_t> rows;
  for (const EventTerm& event : fit.model.events)
    if (KindOf(fit, event) == StepKind::kCommand) rows.insert(event.row);
  return rows.size();
}

// Steps that a look finds in a unit.
struct UnitSteps {
  std::vector<EventTerm> found;
  std::vector<EventTerm> replaced = {};  // steps of the model that go
};

// Steps in place of all that the model has of the unit.
UnitSteps InPlaceOfAll(const Fit& fit, std::size_t unit, std::vector<EventTerm> steps) {
  UnitSteps exchange{.found = std::move(steps)};
  for (const EventTerm& event : fit.model.events)
    if (event.unit == unit) exchange.replaced.push_back(event);
  return exchange;
}

UnitSteps SlipsByCount(const Fit& fit, std::size_t unit, std::span<const EventTerm> known,
                       double price_of_other) {
  const SlipPrices prices = PricesByCount(fit, known, unit);
  if (auto anew = SlipsAnew(fit, unit, prices, price_of_other))
    return InPlaceOfAll(fit, unit, std::move(*anew));
  return {.found = FindSlips(fit, unit, prices, false)};
}

UnitSteps LostByCount(const Fit& fit, std::size_t unit, double price, double price_of_other) {
  if (auto anew = LostMovesAnew(fit, unit, price, price_of_other))
    return InPlaceOfAll(fit, unit, std::move(*anew));
  return {.found = FindLostMoves(fit, unit, price)};
}

// Exchanges what goes for what was found, and returns the number of changes. Steps of an axis in
// one move are one step.
std::size_t TakeSteps(std::vector<UnitSteps>* of_unit, std::vector<EventTerm>* events) {
  std::size_t changes = 0;
  const auto is_same = [](const EventTerm& a, const EventTerm& b) {
    return a.unit == b.unit && a.row == b.row && a.axis == b.axis && a.stays == b.stays;
  };
  for (UnitSteps& steps : *of_unit) {
    for (const EventTerm& gone : steps.replaced)
      changes += std::erase_if(*events, [&](const EventTerm& one) { return is_same(one, gone); });
    for (const EventTerm& found : steps.found) {
      ++changes;
      const auto same =
          std::ranges::find_if(*events, [&](const EventTerm& one) { return is_same(one, found); });
      if (same == events->end())
        events->push_back(found);
      else
        same->step_deg += found.step_deg;
    }
    steps = {};
  }
  constexpr double kRounding_deg = 1e-9;  // of two steps that undo each other
  std::erase_if(*events,
                [](const EventTerm& one) { return std::abs(one.step_deg) < kRounding_deg; });
  return changes;
}

}  // namespace

std::size_t AddEvents(double family_wise, Fit* fit) {
  const std::size_t units = fit->model.units.size();
  std::vector<UnitSteps> of_unit(units);
  std::vector<CampaignUnit> geometry = fit->model.units;
  const std::vector<UnitChunk> chunks = ChunksOf(units);
  const auto each_unit = [&](const auto& find) {
    fit->parallel(chunks.size(), [&](std::size_t chunk) {
      for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
        of_unit[unit] = find(unit);
    });
  };
  const auto take = [&] {
    const std::size_t changes = TakeSteps(&of_unit, &fit->model.events);
    if (changes == 0) return changes;
    fit->model.units = geometry;
    UpdateResiduals(fit);
    SettleFit(fit, 3);
    return changes;
  };
  each_unit([&](std::size_t unit) {
    return UnitSteps{.found = ExactSteps(*fit, unit, &geometry[unit])};
  });
  take();
  // Slips make the noise of the others: each round finds those that it had hidden. The last ones
  // are found by how often the units slip.
  constexpr int kRounds = 12;
  const SlipPrices of_first = PricesOfFirst(*fit, family_wise);
  bool by_count = false;
  for (int round = 0; round < kRounds; ++round) {
    geometry = fit->model.units;
    if (by_count)
      each_unit([&, known = SlipsOf(*fit)](std::size_t unit) {
        return SlipsByCount(*fit, unit, known, of_first[kTheta][0]);
      });
    else
      each_unit([&](std::size_t unit) {
        return UnitSteps{.found = FindSlips(*fit, unit, of_first, true)};
      });
    if (take() > 0) continue;
    if (by_count || SlipsOf(*fit).empty()) break;
    by_count = true;
  }
  for (int round = 0; round < kRounds; ++round) {
    const std::size_t known = LostMovesOf(*fit);
    if (known == 0) break;
    geometry = fit->model.units;
    each_unit([&, price = PriceOfLostMove(*fit, known)](std::size_t unit) {
      return LostByCount(*fit, unit, price, of_first[kTheta][0]);
    });
    if (take() == 0) break;
  }
  return fit->model.events.size();
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

struct Step {
  EventTerm event;
  double log_likelihood = 0;
};

CauseFound CauseOfSteps(const Fit& fit, std::string_view name, std::string_view paragraph,
                        const std::vector<Step>& steps) {
  CauseFound cause = CauseNamed(name);
  cause.scope = "unit";
  cause.amplitude_unit = kEvents;
  std::set<std::uint32_t> units;
  std::set<std::size_t> axes, moves;  // a lost move has an event of each axis
  double square = 0;
  for (const auto& [event, log_likelihood] : steps) {
    cause.delta_log_likelihood += log_likelihood;
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
    std::vector<Step> events;
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
  const std::vector<double> log_likelihood = LogLikelihoodOfEvents(fit);
  for (std::size_t k = 0; k < fit.model.events.size(); ++k) {
    const Step step{fit.model.events[k], log_likelihood[k]};
    const StepKind kind = KindOf(fit, step.event);
    if (kind == StepKind::kCommand) {
      commands.events.push_back(step);
    } else if (has_met(step.event, kind)) {
      contacts.events.push_back(step);
    } else if (kind == StepKind::kTurns) {
      turns.events.push_back(step);
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
      reported.push_back({.covariate = "unit_id",
                          .channel = "unit " + std::to_string(fit.model.units[event.unit].id) +
                                     " stands elsewhere since move " +
                                     std::to_string(fit.facts->campaign->move_id[event.row]),
                          .size_um = SizeOf_um(fit, event),
                          .casts_doubt = false});
  return reported;
}

}  // namespace focalfleet::sim
