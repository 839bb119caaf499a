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

// The variance of standard numbers, without those that are far off.
double ExcessOf(std::vector<double> off) {
  constexpr double kSigmaOfMedian = 1.4826;  // standard deviation of a normal law by its median
  if (off.empty()) return 1;
  const double scatter = kSigmaOfMedian * MiddleOf(std::move(off));
  return std::max(scatter * scatter, 1.0);
}

}  // namespace

bool IsOfTheWhole(const Template& form) {
  return form.effect->owner == Owner::kPlate || form.effect->owner == Owner::kCamera;
}

NoiseLevels LevelsOf(const std::vector<Score>& scores, const Templates& templates,
                     const ParallelFor& parallel) {
  constexpr std::size_t kTemplatesMin = 20;  // that say what most have in common
  // Noise that is fitted to the same residuals is not wrong by more. Half and twice: never reached.
  constexpr double kLeast = 0.5;
  std::vector<Taken> found(templates.size());
  parallel(templates.size(), [&](std::size_t k) {
    if (templates[k].shape_of_unit.empty() && !IsOfTheWhole(templates[k]))
      found[k] = TakenBy(scores[k], templates[k].columns);
  });
  std::erase_if(found, [](const Taken& one) { return !(one.freedom > 0); });
  if (found.size() < kTemplatesMin) return {};
  std::vector<double> means, below, around;
  for (const Taken& one : found) means.push_back(one.mean);
  const double mean = std::clamp(MiddleOf(std::move(means)), kLeast, 1.0);
  for (const Taken& one : found) {
    const double off = (one.mean / mean - 1) * std::sqrt(one.freedom / 2);
    around.push_back(std::abs(off));
    if (off < 0) below.push_back(-off);
  }
  return {{mean, ExcessOf(std::move(below))}, {mean, ExcessOf(std::move(around))}};
}

}  // namespace focalfleet::sim
