#include "sim/diagnosis/series.h"

#include <algorithm>

#include "sim/diagnosis/families.h"
#include "sim/diagnosis/multi_start.h"
#include "sim/diagnosis/screen.h"

namespace focalfleet::sim {
namespace {

// From the last to the first, which is how they can be erased.
std::vector<std::size_t> SeriesOf(const CampaignModel& model, EffectAxis axis) {
  std::vector<std::size_t> series;
  for (std::size_t t = model.terms.size(); t-- > 0;)
    if (model.terms[t].form.axis == axis && IsOfAngle(model.terms[t].form.effect->cause))
      series.push_back(t);
  return series;
}

template <class Members>
void Erase(const std::vector<std::size_t>& last_first, Members* members) {
  for (const std::size_t at : last_first)
    members->erase(members->begin() + static_cast<std::ptrdiff_t>(at));
}

void FitAnew(Fit* fit) {
  constexpr int kRounds = 2;
  UpdateResiduals(fit);
  StepFit(fit);
  SettleFit(fit, kRounds);
}

}  // namespace

void DropSeries(double family_wise, std::uint64_t seed, Fit* fit, Selection* selection) {
  for (const EffectAxis axis : {EffectAxis::kTheta, EffectAxis::kPhi}) {
    const std::vector<std::size_t> series = SeriesOf(fit->model, axis);
    if (series.size() < 2) continue;
    Fit without = *fit;
    Erase(series, &without.model.terms);
    FitAnew(&without);
    const auto left = FindStructure(without, family_wise, seed);
    if (!left || !left->told.channel.starts_with(Name(axis)) ||
        left->told.covariate != kCommand[axis == EffectAxis::kTheta ? kTheta : kPhi])
      continue;
    Fit rippled = without;
    rippled.model.terms.push_back(left->term);
    FitAnew(&rippled);
    if (BetterBy(rippled, *fit) <= 0) continue;
    *fit = std::move(without);
    Erase(series, &selection->accepted);
  }
}

}  // namespace focalfleet::sim
