#include "sim/campaigns/diagnosis/steps_instead.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "sim/campaigns/diagnosis/events.h"
#include "sim/campaigns/diagnosis/multi_start.h"
#include "sim/campaigns/diagnosis/term_trace.h"

namespace focalfleet::sim {
namespace {

constexpr double kAllButAlone = 0.9;  // of the squares of the term's effect

double ShareOf(const TermTrace& trace, const std::vector<std::size_t>& units) {
  double theirs = 0;
  for (const std::size_t unit : units) theirs += trace.square_um2[unit];
  const double all = std::accumulate(trace.square_um2.begin(), trace.square_um2.end(), 0.0);
  return all > 0 ? theirs / all : 0;
}

bool LivesInFewUnits(const TermTrace& trace) {
  constexpr std::size_t kFew = 4;
  std::vector<std::size_t> units(trace.square_um2.size());
  std::iota(units.begin(), units.end(), 0);
  if (units.size() <= kFew) return true;
  std::ranges::partial_sort(units, units.begin() + kFew, std::ranges::greater{},
                            [&](std::size_t unit) { return trace.square_um2[unit]; });
  units.resize(kFew);
  return ShareOf(trace, units) > kAllButAlone;
}

// The fit without all shapes of a cause on its axis: another shape would take what the removed one
// explained.
Fit WithoutCauseOf(const Fit& fit, const ModelTerm& term) {
  constexpr int kRounds = 2;
  Fit without = fit;
  std::erase_if(without.model.terms, [&](const ModelTerm& other) {
    return other.form.effect == term.form.effect && other.form.axis == term.form.axis;
  });
  UpdateResiduals(&without);
  StepFit(&without);
  SettleFit(&without, kRounds);
  return without;
}

// Units that have few steps, all of them small, those with the smallest steps first. A unit that
// has met its neighbour is half of a contact, and is not tried alone.
std::vector<std::size_t> UnitsWithSmallSteps(const Fit& fit) {
  constexpr std::size_t kUnitsMost = 8, kFew = 4;
  constexpr double kSmall_deg = 3;
  struct Steps {
    std::size_t count = 0;
    double sum_deg = 0;
    bool small = true;
  };
  std::map<std::size_t, Steps> of_unit;
  for (const EventTerm& event : fit.model.events) {
    Steps& steps = of_unit[event.unit];
    ++steps.count;
    steps.sum_deg += std::abs(event.step_deg);
    steps.small = steps.small && std::abs(event.step_deg) < kSmall_deg && !IsOfContact(fit, event);
  }
  std::vector<std::pair<double, std::size_t>> least;
  for (const auto& [unit, steps] : of_unit)
    if (steps.small && steps.count <= kFew) least.emplace_back(steps.sum_deg, unit);
  std::ranges::sort(least);
  least.resize(std::min(least.size(), kUnitsMost));
  std::vector<std::size_t> units;
  for (const auto& [sum_deg, unit] : least) units.push_back(unit);
  return units;
}

}  // namespace

void CompareWithSteps(const Fit& fit, double family_wise, Selection* selection) {
  constexpr double kClearly = 20;  // a step has to be better by it, as otherwise none is named
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    const TermTrace trace = TraceOf(fit, fit.model.terms[t]);
    if (!LivesInFewUnits(trace)) continue;
    Fit stepped = WithoutCauseOf(fit, fit.model.terms[t]);
    const std::size_t before = stepped.model.events.size();
    if (AddEvents(family_wise, &stepped) == 0) continue;
    const double behind = BetterBy(fit, stepped);
    if (behind >= kClearly) continue;
    std::vector<EventTerm>& events = stepped.model.events;
    events.erase(events.begin(), events.begin() + static_cast<std::ptrdiff_t>(before));
    std::vector<std::size_t> units;
    for (const EventTerm& event : events) units.push_back(event.unit);
    std::ranges::sort(units);
    units.erase(std::unique(units.begin(), units.end()), units.end());
    if (ShareOf(trace, units) <= kAllButAlone) continue;
    for (const CauseFound& steps : EventCauses(stepped))
      for (const std::string_view name : {kStepLoss, kLostCommand, kContact})
        if (steps.cause == name) selection->accepted[t].rivals.push_back({name, behind, 1, false});
  }
}

void DropNeedlessSteps(Fit* fit) {
  constexpr double kClearly = 20;  // the same bound as when steps are taken
  constexpr int kRounds = 2;
  if (fit->model.terms.empty()) return;
  for (const std::size_t unit : UnitsWithSmallSteps(*fit)) {
    Fit without = *fit;
    std::erase_if(without.model.events, [&](const EventTerm& event) { return event.unit == unit; });
    UpdateResiduals(&without);
    StepFit(&without);
    SettleFit(&without, kRounds);
    if (BetterBy(*fit, without) < kClearly) *fit = std::move(without);
  }
}

}  // namespace focalfleet::sim
