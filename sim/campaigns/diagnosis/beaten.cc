#include "sim/campaigns/diagnosis/beaten.h"

#include <algorithm>
#include <string_view>

#include "sim/campaigns/diagnosis/families.h"
#include "sim/campaigns/diagnosis/multi_start.h"
#include "sim/campaigns/diagnosis/screen.h"

namespace focalfleet::sim {
namespace {

// Indices of terms, from the last to the first, so that they can be erased in this order.
using LastFirst = std::vector<std::size_t>;

LastFirst SeriesOf(const CampaignModel& model, EffectAxis axis) {
  LastFirst series;
  for (std::size_t t = model.terms.size(); t-- > 0;)
    if (model.terms[t].form.axis == axis &&
        model.terms[t].form.effect->traits.IsOf(Family::kAngles))
      series.push_back(t);
  return series;
}

template <class Members>
void Erase(const LastFirst& last_first, Members* members) {
  for (const std::size_t at : last_first)
    members->erase(members->begin() + static_cast<std::ptrdiff_t>(at));
}

// Whether the structure follows the cause's own column: a bend there is the cause's shape, not
// another structure.
bool IsOwnShape(const Effect& effect, const UnknownFound& reported) {
  return effect.traits.by_direction && std::ranges::count(effect.needs, reported.covariate) != 0 &&
         reported.channel.find("against its direction") != std::string::npos;
}

// Whether a structure follows where this axis stands.
auto AtAngleOf(EffectAxis axis) {
  return [axis](const UnknownFound& reported) {
    return reported.channel.starts_with(Name(axis)) &&
           reported.covariate == kCommand[axis == EffectAxis::kTheta ? kTheta : kPhi];
  };
}

bool IsBump(const ModelTerm& term) { return term.form.effect->traits.is_bump; }

// The series without the terms that are not part of the structure. A separate ripple explains as
// much beside a curve for the structure as it does alone, whatever its many amplitudes cost.
LastFirst WithoutItsOwn(const Fit& fit, const LastFirst& series, const ModelTerm& curve) {
  constexpr double kOfItsOwn = 0.5, kOfChance = 2;
  Fit without = fit;
  Erase(series, &without.model.terms);
  FitAnew(&without);
  Fit curved = without;
  curved.model.terms.push_back(curve);
  FitAnew(&curved);
  struct Explains {
    double by = 0, chance = 0;  // 2 d ln L at no price; the part that its parameters give by chance
  };
  const auto explains = [&](std::size_t term, const Fit& beside) {
    Fit with = beside;
    with.model.terms.push_back(fit.model.terms[term]);
    FitAnew(&with);
    return Explains{BetterBy(with, beside) + PriceOf(with) - PriceOf(beside),
                    CountParameters(with) - CountParameters(beside)};
  };
  const auto is_own = [&](std::size_t term) {
    const Explains beside = explains(term, curved);
    return beside.by > kOfChance * beside.chance &&
           beside.by > kOfItsOwn * explains(term, without).by;
  };
  LastFirst left;
  for (const std::size_t term : series)
    if (!fit.model.terms[term].form.effect->traits.is_ripple || !is_own(term)) left.push_back(term);
  return left;
}

// The margin by which a name must be beaten, and the empirical term that does so.
struct Beaten {
  double family_wise;
  std::uint64_t seed;
  Fit* fit;
  Selection* selection;

  /// Removes the terms where an empirical term beats them, and returns whether it did. `counts`:
  /// whether a structure could be what they are.
  template <class Counts>
  bool DropIf(const LastFirst& terms, double better_by, const Counts& counts) const {
    Fit without = *fit;
    Erase(terms, &without.model.terms);
    FitAnew(&without);
    const auto left = FindStructure(without, family_wise, seed);
    if (!left || !counts(left->reported)) return false;
    Fit curved = without, named = *fit;
    curved.model.terms.push_back(left->term);
    FitAnew(&curved);
    FitAnew(&named);
    if (BetterBy(curved, named) <= better_by) return false;
    // A term that is as good alone is the structure itself: the others are beside it.
    constexpr double kUndecided = 6;
    const auto is_the_structure = [&](std::size_t term) {
      Fit one = without;
      one.model.terms.push_back(named.model.terms[term]);
      FitAnew(&one);
      return BetterBy(curved, one) <= kUndecided;
    };
    if (terms.size() > 1 && std::ranges::any_of(terms, is_the_structure)) return false;
    // A term that has nothing to do with the structure explains beside it what it explains alone.
    constexpr double kOfItsOwn = 0.5;
    Fit both = named;
    both.model.terms.push_back(left->term);
    FitAnew(&both);
    const double alone = BetterBy(named, without);
    if (alone > 0 && BetterBy(both, curved) > kOfItsOwn * alone) return false;
    if (terms.size() > 1) {
      const LastFirst of_structure = WithoutItsOwn(named, terms, left->term);
      if (of_structure.size() < 2) return false;
      if (of_structure.size() < terms.size()) return DropIf(of_structure, better_by, counts);
    }
    *fit = std::move(without);
    Erase(terms, &selection->accepted);
    return true;
  }
};

}  // namespace

void DropBeaten(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection) {
  // The margin is from 400 hidden campaigns. Right names were beaten by 10 at most, by the shape of
  // their own column. Wrong ones were beaten by 35 and more, but for two.
  constexpr double kClearly = 20;
  const Beaten beaten{family_wise, seed, fit, selection};
  for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi}) {
    const LastFirst series = SeriesOf(fit->model, axis);
    if (series.size() < 2) continue;
    // Bumps at several places: where they are no wave, no wave comes near.
    const auto bumps =
        std::ranges::count_if(series, [&](std::size_t t) { return IsBump(fit->model.terms[t]); });
    beaten.DropIf(series, bumps < 2 ? 0 : -kClearly * static_cast<double>(bumps), AtAngleOf(axis));
  }
  for (std::size_t t = fit->model.terms.size(); t-- > 0;) {
    const Effect& effect = *fit->model.terms[t].form.effect;
    if (IsBump(fit->model.terms[t]))
      beaten.DropIf({t}, -kClearly, AtAngleOf(fit->model.terms[t].form.axis));
    else if (effect.traits.IsOf(Family::kNight))
      beaten.DropIf({t}, kClearly,
                    [&](const UnknownFound& reported) { return !IsOwnShape(effect, reported); });
  }
}

}  // namespace focalfleet::sim
