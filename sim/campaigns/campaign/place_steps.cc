#include "sim/campaigns/campaign/place_steps.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace focalfleet::sim {
namespace {

constexpr std::size_t kValuesMax = 20000;  // values that a step is sought in, evenly from all
constexpr double kSame_mm = 1e-8;          // arithmetic on equal numbers leaves less
constexpr double kNearStep = 0.05;         // share of a step; a gap as near is a multiple
constexpr double kShareOfChance = 2 * kNearStep;
// Share of the gaps; others were merged in, or measured otherwise.
constexpr double kMostlyAre = 0.95;
constexpr double kChance = 1e-6;  // probability that gaps of any size look like multiples
constexpr int kMultiplesMax = 6;  // multiples of the step that the most frequent gap may be

// The distinct values, ascending.
std::vector<double> Distinct(std::span<const double> values) {
  std::vector<double> sorted;
  const std::size_t stride = std::max<std::size_t>(1, values.size() / kValuesMax);
  for (std::size_t k = 0; k < values.size(); k += stride)
    if (std::isfinite(values[k])) sorted.push_back(values[k]);
  std::ranges::sort(sorted);
  const auto same = [](double a, double b) { return b - a < kSame_mm; };
  sorted.erase(std::unique(sorted.begin(), sorted.end(), same), sorted.end());
  return sorted;
}

// Euclid's algorithm on numbers that arithmetic has rounded.
double CommonMeasure(std::span<const double> gaps) {
  double measure = 0;
  for (const double gap : gaps) {
    double a = gap;
    while (a > kSame_mm) {
      const double left = std::abs(std::remainder(measure, a));
      measure = a, a = left;
    }
    if (measure < 10 * kSame_mm) break;
  }
  return measure;
}

// The mean of the gaps that are most often alike.
double MostFrequent(std::span<const double> ascending) {
  constexpr double kAlike = 1e-3;  // relative: numbers of few digits round a step that has more
  double best = 0;
  std::size_t most = 0;
  for (std::size_t begin = 0, end = 0; begin < ascending.size(); begin = end) {
    double sum = 0;
    for (end = begin; end < ascending.size() && ascending[end] <= ascending[begin] * (1 + kAlike);
         ++end)
      sum += ascending[end];
    if (end - begin <= most) continue;
    most = end - begin;
    best = sum / static_cast<double>(most);
  }
  return best;
}

// Whether more gaps are multiples of the step than chance makes so.
bool AreMultiples(std::span<const double> gaps, double step) {
  if (!(step > 10 * kSame_mm)) return false;
  // A gap is between distinct values, so none is zero steps wide: units that stand far apart have
  // places in clusters, whose gaps are near nothing and near the units' distance.
  std::size_t near = 0;
  for (const double gap : gaps)
    if (gap > step / 2 && std::abs(std::remainder(gap, step)) <= kNearStep * step) ++near;
  const auto n = static_cast<double>(gaps.size());
  // The gap that has made the step proves nothing, hence n - 1.
  return static_cast<double>(near) >= kMostlyAre * n &&
         (n - 1) * std::log(kShareOfChance) + std::log(n * kMultiplesMax) < std::log(kChance);
}

}  // namespace

double FindStep(std::span<const double> values) {
  const std::vector<double> distinct = Distinct(values);
  if (distinct.size() < 3) return 0;
  std::vector<double> gaps;
  for (std::size_t k = 1; k < distinct.size(); ++k) gaps.push_back(distinct[k] - distinct[k - 1]);
  std::ranges::sort(gaps);
  const double frequent = MostFrequent(gaps);
  double step = 0;
  for (int of = 1; of <= kMultiplesMax && step == 0; ++of)
    if (AreMultiples(gaps, frequent / of)) step = frequent / of;
  const double common = CommonMeasure(gaps);
  if (common > step && AreMultiples(gaps, common)) step = common;
  // Values that are too few to show a wider step still show their digits.
  return std::max(step, LastDigitOf(distinct));
}

double LastDigitOf(std::span<const double> values) {
  constexpr double kDigitsMost = 1e6;
  double per_unit = 1;
  bool any = false;
  for (const double value : values) {
    if (!std::isfinite(value)) continue;
    any = true;
    while (std::abs(std::remainder(value * per_unit, 1)) > 1e-3) {
      per_unit *= 10;
      if (per_unit > kDigitsMost) return 0;
    }
  }
  return any ? 1 / per_unit : 0;
}

PlaceSteps FindPlaceSteps(const Campaign& campaign) {
  if (campaign.steps_mm) return {(*campaign.steps_mm)[0], (*campaign.steps_mm)[1]};
  return {FindStep(campaign.x_mm), FindStep(campaign.y_mm)};
}

double SpreadOfStep(double step) { return step / std::sqrt(12.0); }

double LeastNoise_um(const Campaign& campaign, const PlaceSteps& steps) {
  return std::max({kNoiseLeast_um, 1e3 * SpreadOfStep(steps.wider_mm()),
                   SpreadOfStep(LastDigitOf(campaign.Find("sigma_um")))});
}

}  // namespace focalfleet::sim
