#include "sim/campaigns/diagnosis/score/noise_level.h"

#include <algorithm>
#include <cmath>

#include "sim/campaigns/diagnosis/model/chances.h"

namespace focalfleet::sim {
namespace {

using Eigen::Index;
constexpr int kColumns = static_cast<int>(kColumnsMax);
using OwnScore = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kColumns, 1>;
using OwnNormal = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kColumns, kColumns>;

// Chi-square for each degree of freedom of the units' own amplitudes.
struct Taken {
  double mean = 0, freedom = 0;
};
Taken TakenBy(const Score& score, std::size_t columns) {
  Taken sum;
  const auto c = static_cast<Index>(columns);
  for (std::size_t unit = 0; unit < score.b.size() / columns; ++unit) {
    const Eigen::Map<const OwnScore> b(score.b.data() + unit * columns, c);
    const Eigen::Map<const OwnNormal> g(score.g.data() + unit * columns * columns, c, c);
    if (!(g.trace() > 0)) continue;
    const Eigen::CompleteOrthogonalDecomposition<OwnNormal> solver(g);
    const OwnScore amplitude = solver.solve(b);
    sum.mean += b.dot(amplitude);
    sum.freedom += static_cast<double>(solver.rank());
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
  constexpr std::size_t kTemplatesMin = 20;  // that say what most have in common
  // Noise that is fitted to the same residuals is hardly wrong by more. Half of it: not measured.
  constexpr double kLeast = 0.5;
  constexpr double kSigmaOfMedian = 1.4826;  // standard deviation of a normal law by its median
  std::vector<Taken> found(templates.size());
  parallel(templates.size(), [&](std::size_t k) {
    if (templates[k].shape_of_unit.empty() && !IsOfTheWhole(templates[k]))
      found[k] = TakenBy(scores[k], templates[k].columns);
  });
  std::erase_if(found, [](const Taken& one) { return !(one.freedom > 0); });
  if (found.size() < kTemplatesMin) return {};
  std::vector<double> means, below;
  for (const Taken& one : found) means.push_back(one.mean);
  NoiseLevel level{.mean = std::clamp(MiddleOf(std::move(means)), kLeast, 1.0)};
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
