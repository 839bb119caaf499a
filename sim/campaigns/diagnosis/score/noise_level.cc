#include "sim/campaigns/diagnosis/score/noise_level.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

// Chi-square for each degree of freedom of the units' own amplitudes.
struct Taken {
  double mean = 0, freedom = 0;
};
Taken TakenBy(const Score& score, std::size_t columns) {
  Taken sum;
  for (std::size_t unit = 0; unit < score.b.size() / columns; ++unit) {
    const OwnFit own = FitOwn(score, columns, unit);
    sum.mean += own.chi_square, sum.freedom += own.freedom;
  }
  if (sum.freedom > 0) sum.mean /= sum.freedom;
  return sum;
}

}  // namespace

bool IsOfTheWhole(const Template& form) {
  return form.effect->owner == Owner::kPlate || form.effect->owner == Owner::kCamera;
}

NoiseLevel LevelOf(const std::vector<Score>& scores, const Templates& templates,
                   const ParallelFor& parallel) {
  // Templates that say what most have in common. The library lists hundreds; fewer are rivals
  // alone. Half and twice of it change no verdict and no candidate of 61 campaigns of three
  // generators.
  constexpr std::size_t kTemplatesMin = 20;
  std::vector<Taken> found(templates.size());
  parallel(templates.size(), [&](std::size_t k) {
    if (templates[k].shape_of_unit.empty() && !IsOfTheWhole(templates[k]))
      found[k] = TakenBy(scores[k], templates[k].columns);
  });
  std::erase_if(found, [](const Taken& one) { return !(one.freedom > 0); });
  if (found.size() < kTemplatesMin) return {};
  std::vector<double> means, below;
  for (const Taken& one : found) means.push_back(one.mean);
  NoiseLevel level{.mean = std::min(MiddleOf(std::move(means)), 1.0)};
  if (!(level.mean > 0)) return {};
  // Effects only add to chi-square: its scatter by noise is seen below the middle.
  for (const Taken& one : found)
    if (one.mean < level.mean)
      below.push_back((1 - one.mean / level.mean) * std::sqrt(one.freedom / 2));
  if (below.empty()) return level;
  const double scatter = kSigmaOfMedian * MiddleOf(std::move(below));
  level.excess = std::max(scatter * scatter, 1.0);
  return level;
}

}  // namespace focalfleet::sim
