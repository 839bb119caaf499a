// A rival is another cause that could have made the same picture. Its own signature, run through
// the same plant on the same commands, is fitted to the effect's, with the static geometry free. A
// rival has the same freedom as the effect. Common effects have one coefficient, and others have
// one per unit (and phase).
#include <algorithm>
#include <cmath>
#include <map>

#include "tests/hidden/generator/judge_effects.h"

namespace focalfleet::hidden {

namespace {

constexpr std::size_t kUnitsLooked = 14;  // a cosine needs no more, and costs by units

struct Data {
  std::vector<std::size_t> units;
  std::vector<UnitSpace> spaces;
  std::vector<Column> target;  // by unit
  double norm = 0;
};

Data DataOf(const Scene& scene, const NoiseModel& noise, const std::vector<char>& seen,
            const Effect& effect) {
  const Campaign& campaign = *scene.campaign;
  Data data;
  std::vector<std::size_t> concerned;
  for (std::size_t u = 0; u < effect.weight.size(); ++u)
    if (effect.weight[u] != 0) concerned.push_back(u);
  const std::size_t count = std::min(kUnitsLooked, concerned.size());
  for (std::size_t i = 0; i < count; ++i)  // evenly over the list, and so over the plate
    data.units.push_back(concerned[i * concerned.size() / count]);
  const Truth believed = Believed(campaign);
  const auto with = RunPlant(scene, believed, {&effect, 1}, data.units);
  const auto without = RunPlant(scene, believed, {}, data.units);
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<char> used(campaign.move_count());
    for (std::size_t m = 0; m < used.size(); ++m)
      used[m] = seen[m * campaign.unit_count() + data.units[i]];
    data.spaces.emplace_back(campaign, noise, data.units[i], used);
    std::vector<Place> um(used.size());
    for (std::size_t m = 0; m < um.size(); ++m) um[m] = 1000.0 * (with[i][m] - without[i][m]);
    data.target.push_back(data.spaces[i].Project(um));
    data.norm += Dot(data.target[i], data.target[i]);
  }
  return data;
}

// The rival's projected signature, by unit.
std::vector<Column> Signature(const Scene& scene, const Data& data, const Effect& rival) {
  const Truth believed = Believed(*scene.campaign);
  const auto with = RunPlant(scene, believed, {&rival, 1}, data.units);
  const auto without = RunPlant(scene, believed, {}, data.units);
  std::vector<Column> out;
  for (std::size_t i = 0; i < data.units.size(); ++i) {
    std::vector<Place> um(with[i].size());
    for (std::size_t m = 0; m < um.size(); ++m) um[m] = 1000.0 * (with[i][m] - without[i][m]);
    out.push_back(data.spaces[i].Project(um));
  }
  return out;
}

double Explained(const Data& data, const std::vector<std::vector<Column>>& signatures,
                 bool by_unit) {
  double explained = 0;
  if (by_unit) {
    for (std::size_t i = 0; i < data.units.size(); ++i) {
      std::vector<Column> basis;
      for (const auto& signature : signatures) Extend(&basis, signature[i]);
      for (const Column& q : basis) explained += std::pow(Dot(q, data.target[i]), 2);
    }
    return explained / data.norm;
  }
  const auto joined = [](const std::vector<Column>& parts) {
    Column whole;
    for (const Column& part : parts) whole.insert(whole.end(), part.begin(), part.end());
    return whole;
  };
  const Column target = joined(data.target);
  std::vector<Column> basis;
  for (const auto& signature : signatures) Extend(&basis, joined(signature));
  for (const Column& q : basis) explained += std::pow(Dot(q, target), 2);
  return explained / data.norm;
}

Effect Probe(const EffectKind& kind, const Effect& of, std::size_t axis, double shape,
             double phase) {
  Effect probe;
  probe.kind = &kind;
  probe.axis = axis;
  probe.owner = of.owner;
  probe.size = 1;
  probe.shape = {shape, 0.25, 0.5, 0.5};
  probe.read_through = 23e-6;
  probe.weight.assign(of.weight.size(), 1);
  probe.phase_rad.assign(of.weight.size(), phase);
  return probe;
}

// A large effect that turns with the rotor bends, so that two phases no longer span it. The rival
// is therefore tried as large as the effect, at phases all around, with the best phase of each
// unit.
double ExplainedAtItsSize(const Scene& scene, const Data& data, const EffectKind& kind,
                          const Effect& of, std::size_t axis, double shape) {
  constexpr int kPhases = 48;  // 1 - cosine of half a step: 0.002
  std::vector<double> best(data.units.size(), 0);
  for (int p = 0; p < kPhases; ++p) {
    Effect probe = Probe(kind, of, axis, shape, 2 * kPi * p / kPhases);
    probe.size = of.size * of.kind->typical / kind.typical;
    probe.weight = of.weight;
    const std::vector<Column> signature = Signature(scene, data, probe);
    for (std::size_t i = 0; i < data.units.size(); ++i) {
      const double square = Dot(signature[i], signature[i]);
      if (square > 0)
        best[i] = std::max(best[i], std::pow(Dot(signature[i], data.target[i]), 2) / square);
    }
  }
  double explained = 0;
  for (const double one : best) explained += one;
  return explained / data.norm;
}

bool TurnsWithTheRotor(const EffectKind& kind) {
  return kind.cause == "cogging" || kind.cause == "phase_imbalance";
}

}  // namespace

std::vector<Rival> FindRivals(const Scene& scene, const NoiseModel& noise,
                              const std::vector<char>& seen, const Effect& effect) {
  std::vector<Rival> rivals;
  if (effect.kind->is_event) return rivals;
  const Data data = DataOf(scene, noise, seen, effect);
  if (data.norm <= 0) return rivals;
  const bool by_unit = effect.owner == Owner::kUnit;
  for (const EffectKind& kind : Catalogue()) {
    if (kind.is_event || IsForeign(kind) || kind.cause == effect.kind->cause) continue;
    if (kind.cause == "sensor_bias") continue;  // moves nothing by itself
    double best = 0;
    const std::size_t axes = kind.axis == AxisUse::kEither ? 2 : 1;
    for (std::size_t axis = 0; axis < axes; ++axis)
      for (const double shape : {0.1, 0.4, 0.7, 0.95}) {
        std::vector<std::vector<Column>> signatures;
        for (int p = 0; p < kind.phases; ++p)
          signatures.push_back(
              Signature(scene, data, Probe(kind, effect, axis, shape, p * kPi / 2)));
        best = std::max(best, Explained(data, signatures, by_unit));
        if (by_unit && TurnsWithTheRotor(kind) && TurnsWithTheRotor(*effect.kind))
          best = std::max(best, ExplainedAtItsSize(scene, data, kind, effect, axis, shape));
      }
    const double cosine = std::sqrt(std::clamp(best, 0.0, 1.0));
    if (cosine >= 0.5) rivals.push_back({std::string(kind.cause), cosine});
  }
  std::sort(rivals.begin(), rivals.end(),
            [](const Rival& a, const Rival& b) { return a.cosine > b.cosine; });
  return rivals;
}

}  // namespace focalfleet::hidden
