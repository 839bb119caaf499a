#include "sim/campaigns/diagnosis/search/beaten.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "sim/campaigns/diagnosis/check/screen.h"
#include "sim/campaigns/diagnosis/search/multi_start.h"
#include "sim/campaigns/effects/rotor_ways.h"

namespace focalfleet::sim {
namespace {

// Indices of terms, from the last to the first, so that they can be erased in this order.
using LastFirst = std::vector<std::size_t>;

// Terms of rotors are left out: their exact waves decide (rotors.h).
LastFirst TermsOf(const CampaignModel& model, EffectAxis axis) {
  LastFirst terms;
  for (std::size_t t = model.terms.size(); t-- > 0;)
    if (model.terms[t].form.axis == axis && !HasRotorWays(model.terms[t].form.effect->cause))
      terms.push_back(t);
  return terms;
}

template <class Members>
void Erase(const LastFirst& last_first, Members* members) {
  for (const std::size_t at : last_first)
    members->erase(members->begin() + static_cast<std::ptrdiff_t>(at));
}

// The empirical term must be better by this, in 2 ln L: it is one of the screen's looks, each name
// one of the library's. A priori one campaign in seven has something outside the library; half and
// double of it move the margin by 1.4.
double Margin(std::size_t names, double library_tests, double looks) {
  constexpr double kUnknown = 1.0 / 7;
  return 2 * (std::log(looks * (1 - kUnknown) / kUnknown) -
              static_cast<double>(names) * std::log(library_tests));
}

// Whether one of the names alone does as well as the empirical term. This name is then the
// structure, and the others are beside it.
bool IsOneOf(const LastFirst& names, const Fit& named, const Fit& without, const Fit& curved) {
  return std::ranges::any_of(names, [&](std::size_t name) {
    Fit one = without;
    one.model.terms.push_back(named.model.terms[name]);
    FitAnew(&one);
    return BetterBy(curved, one) <= 0;
  });
}

void DropIfBeaten(const LastFirst& names, double family_wise, std::uint64_t seed, Fit* fit,
                  Selection* selection) {
  Fit without = *fit;
  Erase(names, &without.model.terms);
  FitAnew(&without);
  const auto left = FindStructure(without, family_wise, seed);
  if (!left) return;
  Fit curved = without;
  curved.model.terms.push_back(left->term);
  FitAnew(&curved);
  const double ahead = BetterBy(curved, *fit) - Margin(names.size(), selection->tests, left->tests);
  if (IsOneOf(names, *fit, without, curved)) return;
  for (const std::size_t name : names) selection->accepted[name].log_odds_of_curve = ahead / 2;
  if (ahead <= 0) return;
  *fit = std::move(without);
  Erase(names, &selection->accepted);
}

}  // namespace

void DropBeaten(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection) {
  for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi})
    if (const LastFirst names = TermsOf(fit->model, axis); names.size() > 1)
      DropIfBeaten(names, family_wise, seed, fit, selection);
}

}  // namespace focalfleet::sim
