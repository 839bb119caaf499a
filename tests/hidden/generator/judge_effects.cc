#include "tests/hidden/generator/judge_effects.h"

#include <algorithm>
#include <cmath>

namespace focalfleet::hidden {

namespace {

std::vector<std::size_t> Concerned(const Effect& effect) {
  std::vector<std::size_t> units;
  for (std::size_t u = 0; u < effect.weight.size(); ++u)
    if (effect.weight[u] != 0) units.push_back(u);
  return units;
}

std::vector<char> SeenOf(const Campaign& campaign, const std::vector<char>& seen,
                         std::size_t unit) {
  std::vector<char> out(campaign.move_count());
  for (std::size_t m = 0; m < out.size(); ++m) out[m] = seen[m * campaign.unit_count() + unit];
  return out;
}

}  // namespace

std::vector<std::vector<Place>> Contribution(const Scene& scene, const Truth& truth,
                                             const Effect& effect) {
  const auto units = Concerned(effect);
  const auto with = RunPlant(scene, truth, {&effect, 1}, units);
  const auto without = RunPlant(scene, truth, {}, units);
  std::vector<std::vector<Place>> out(scene.campaign->unit_count());
  for (std::size_t i = 0; i < units.size(); ++i) {
    auto& um = out[units[i]];
    um.resize(with[i].size());
    for (std::size_t m = 0; m < um.size(); ++m) um[m] = 1000.0 * (with[i][m] - without[i][m]);
  }
  return out;
}

Visibility Assess(const Scene& scene, const NoiseModel& noise, const std::vector<char>& seen,
                  const std::vector<std::vector<Place>>& contribution_um) {
  const Campaign& campaign = *scene.campaign;
  Visibility out;
  out.lambda_by_unit.assign(campaign.unit_count(), 0);
  NoiseModel even = noise;  // for rms in um: every row has the same weight
  even.centroid_um.assign(campaign.unit_count(), 1);
  even.actuation_deg = {};
  double raw = 0;
  double squares = 0;
  double left = 0;
  double rows = 0;
  for (std::size_t u = 0; u < campaign.unit_count(); ++u) {
    const auto& um = contribution_um[u];
    if (um.empty()) continue;
    const auto used = SeenOf(campaign, seen, u);
    const UnitSpace space(campaign, noise, u, used);
    const Column whole = space.Whiten(um);
    const Column projected = space.Project(um);
    raw += Dot(whole, whole);
    out.lambda_by_unit[u] = Dot(projected, projected);
    out.lambda += out.lambda_by_unit[u];
    const UnitSpace plain(campaign, even, u, used);
    const Column in_um = plain.Project(um);
    left += Dot(in_um, in_um);
    for (std::size_t m = 0; m < um.size(); ++m) {
      if (used[m] == 0) continue;
      squares += std::norm(um[m]);
      ++rows;
    }
  }
  out.survival = raw > 0 ? out.lambda / raw : 0;
  out.rms_um = rows > 0 ? std::sqrt(squares / rows) : 0;
  out.rms_left_um = rows > 0 ? std::sqrt(left / rows) : 0;
  return out;
}

double LambdaScale(const Effect& effect) {
  if (effect.owner != Owner::kUnit) return 1;
  const auto concerned = static_cast<double>(Concerned(effect).size());
  if (2 * concerned <= static_cast<double>(effect.weight.size())) return std::max(1.0, concerned);
  if (effect.kind->phases == 1) return 1;
  return (25 + 5 * std::sqrt(2 * 2 * concerned)) / 25;
}

void Tune(const Scene& scene, const Truth& truth, const NoiseModel& noise,
          const std::vector<char>& seen, double lambda_wanted, Effect* effect) {
  if (effect->kind->cause == "identity_swap") return;  // all or nothing: it has no size
  const double sign = effect->size < 0 ? -1 : 1;
  double size = 1;
  double best_size = size;
  double best_miss = 1e300;
  double too_small = 1e-6;  // a bracket in sizes
  double too_large = 1e6;
  double power = 2;  // of the size, in lambda; some effects go by the square of their size
  double last_size = 0;
  double last_lambda = 0;
  for (int i = 0; i < 24; ++i) {
    effect->size = sign * size;
    const double lambda =
        std::max(1e-9, Assess(scene, noise, seen, Contribution(scene, truth, *effect)).lambda);
    const double miss = std::abs(std::log(lambda / lambda_wanted));
    if (miss < best_miss) best_miss = miss, best_size = size;
    if (miss < 0.02) break;
    (lambda < lambda_wanted ? too_small : too_large) = size;
    if (last_size > 0 && last_size != size && last_lambda > 1e-8 && lambda > 1e-8)
      power = std::clamp(std::log(lambda / last_lambda) / std::log(size / last_size), 1.0, 6.0);
    last_size = size;
    last_lambda = lambda;
    double next = size * std::clamp(std::pow(lambda_wanted / lambda, 1 / power), 0.1, 6.0);
    if (next <= too_small || next >= too_large) next = std::sqrt(too_small * too_large);
    next = std::min(next, effect->kind->size_max);
    if (next == size || too_large < 1.0005 * too_small) break;
    size = next;
  }
  effect->size = sign * best_size;
}

StaticVisibility AssessStatic(const Campaign& campaign, const Truth& truth, const NoiseModel& noise,
                              const std::vector<char>& seen) {
  StaticVisibility out;
  const std::array<std::pair<std::array<std::size_t, 2>, double*>, 3> kinds = {
      {{{0, 1}, &out.base_offset}, {{2, 3}, &out.arm_length}, {{4, 5}, &out.zero_offset}}};
  for (std::size_t u = 0; u < campaign.unit_count(); ++u) {
    const Geometry& is = truth.geometry[u];
    const Geometry& was = campaign.units[u].believed;
    const std::array<double, 6> error = {1000 * (is.base_mm - was.base_mm).real(),
                                         1000 * (is.base_mm - was.base_mm).imag(),
                                         1000 * (is.arm_mm[kTheta] - was.arm_mm[kTheta]),
                                         1000 * (is.arm_mm[kPhi] - was.arm_mm[kPhi]),
                                         1000 * (is.zero_deg[kTheta] - was.zero_deg[kTheta]),
                                         1000 * (is.zero_deg[kPhi] - was.zero_deg[kPhi])};
    const UnitSpace space(campaign, noise, u, SeenOf(campaign, seen, u));
    for (const auto& [which, chi2] : kinds) {
      std::vector<Column> others;
      for (std::size_t c = 0; c < 6; ++c)
        if (c != which[0] && c != which[1]) Extend(&others, space.Static(c));
      Column sum = space.Static(which[0]);
      const Column second = space.Static(which[1]);
      for (std::size_t i = 0; i < sum.size(); ++i)
        sum[i] = error[which[0]] * sum[i] + error[which[1]] * second[i];
      TakeOut(others, &sum);
      *chi2 += Dot(sum, sum);
    }
  }
  return out;
}

}  // namespace focalfleet::hidden
