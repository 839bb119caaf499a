#include "sim/campaigns/diagnosis/search/multi_start.h"

#include <algorithm>
#include <numbers>
#include <utility>
#include <vector>

#include "sim/campaigns/diagnosis/terms/events.h"
#include "sim/campaigns/diagnosis/terms/homings.h"

namespace focalfleet::sim {
namespace {

double NegativeBicWith(Fit fit, const Noise& noise) {
  fit.noise = noise;
  UpdateWeights(&fit);
  return NegativeBic(fit);
}

Fit WithEvents(Fit fit, std::vector<EventTerm> events) {
  fit.model.events = std::move(events);
  FitAnew(&fit);
  return fit;
}

// Selects with and without steps in single units' angles, and takes the better fit for its price.
Selection SelectWithEvents(const Templates& templates, const SelectionRule& rule, Fit* fit) {
  Fit stepped = *fit;
  const bool has_events = AddEvents(rule.family_wise, &stepped) > 0;
  Selection selection = Select(templates, rule, fit);
  if (!has_events) return selection;
  // The effect of a cause on a few moves looks like steps until the cause is known.
  Fit explained = *fit;
  if (AddEvents(rule.family_wise, &explained) == 0) return selection;
  // Steps that do not pay for themselves beside the found terms, neither those found before nor
  // those found after, are no reason for another search.
  if (BetterBy(explained, *fit) <= 0 && BetterBy(WithEvents(*fit, stepped.model.events), *fit) <= 0)
    return selection;
  Selection again = Select(templates, rule, &stepped);
  // A step is a large claim about one move: it has to be worth more than its price. The same holds
  // for a cause.
  constexpr double kClearly = 20, kEach = 10, kCause = 20;
  const auto terms = [](const Fit& one) { return static_cast<double>(one.model.terms.size()); };
  const double price = kClearly + kEach * static_cast<double>(MovesWithEvents(stepped.model)) -
                       kCause * std::max(terms(*fit) - terms(stepped), 0.0);
  const double better = BetterBy(stepped, *fit);
  if (better <= price) return selection;
  *fit = std::move(stepped);
  return again;
}

// Tries zeros that differ from homing to homing, where they are worth their number. Terms and steps
// are then chosen anew, because one homing's zero may have looked like either.
void TryHomings(const Templates& templates, const SelectionRule& rule, Selection* selection,
                Fit* fit) {
  constexpr double kBetterBy = 20;
  Fit freed = *fit;
  FreeHomings(&freed);
  if (NegativeBic(freed) < NegativeBic(*fit) + kBetterBy) return;
  // Many homings of a few moves each follow the noise of these.
  constexpr double kOfNoise = 0.25;
  if (ScatterOfHomings(freed).both_um() < kOfNoise * std::numbers::sqrt2 * freed.noise.typical_um)
    return;
  freed.model.terms.clear();
  freed.model.events.clear();
  UpdateResiduals(&freed);
  FreeHomings(&freed);
  Selection again = SelectWithEvents(templates, rule, &freed);
  if (NegativeBic(freed) < NegativeBic(*fit) + kBetterBy) return;
  *fit = std::move(freed);
  *selection = std::move(again);
}

}  // namespace

double BetterBy(const Fit& fit, const Fit& than) {
  double sum = 0;
  for (const Noise* noise : {&fit.noise, &than.noise})
    sum += NegativeBicWith(fit, *noise) - NegativeBicWith(than, *noise);
  return sum / 2;
}

Selection SelectMultiStart(const Templates& templates, const SelectionRule& rule, Fit* fit) {
  Selection selection = SelectWithEvents(templates, rule, fit);
  if (fit->facts->homings > 0 && fit->facts->closed.empty())
    TryHomings(templates, rule, &selection, fit);
  return selection;
}

}  // namespace focalfleet::sim
