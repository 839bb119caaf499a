#include "tests/hidden/generator/planted.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

namespace focalfleet::hidden {

namespace {

using Json = nlohmann::ordered_json;

// The noise that visibility is computed with: that of the spec, not of its random realisation.
NoiseModel ExpectedNoise(const Spec& spec, const Campaign& campaign, const Truth& truth) {
  NoiseModel noise;
  noise.centroid_um.assign(campaign.unit_count(), spec.centroid_um);
  noise.actuation_deg = truth.actuation_sigma_deg;
  return noise;
}

std::vector<char> Exposed(const Campaign& campaign) {
  std::vector<char> seen;
  seen.reserve(campaign.rows.size());
  for (const Row& row : campaign.rows) seen.push_back(row.exposed ? 1 : 0);
  return seen;
}

const char* NameOfAxis(const Effect& effect) {
  if (effect.kind->axis == AxisUse::kNone) return "none";
  return effect.axis == kTheta ? "theta" : "phi";
}

Json UnitsOf(const Campaign& campaign, const Effect& effect) {
  Json units = Json::array();
  for (std::size_t u = 0; u < campaign.unit_count(); ++u)
    if (effect.weight[u] != 0) units.push_back(campaign.units[u].id);
  if (units.size() == campaign.unit_count()) return "all";
  return units;
}

// The scopes that are right as well: a common effect of the plate is also one of all its units.
Json AlsoScope(const Effect& effect) {
  Json also = Json::array();
  const bool mechanical = effect.kind->owners[0] == Owner::kUnit;
  const auto all = std::all_of(effect.weight.begin(), effect.weight.end(),
                               [](double weight) { return weight != 0; });
  if (effect.owner == Owner::kPlate && mechanical) also.push_back("unit");
  if (effect.owner == Owner::kUnit && all && effect.kind->phases == 1) also.push_back("plate");
  if (effect.owner == Owner::kPlate && effect.kind->owners[0] == Owner::kRail)
    also.push_back("rail");
  if (effect.owner == Owner::kPlate && effect.kind->owners[0] == Owner::kBus) also.push_back("bus");
  return also;
}

Json EffectJson(const Planted& planted, const Scene& scene, const Effect& effect,
                double lambda_wanted) {
  const Campaign& campaign = planted.campaign;
  const NoiseModel noise = ExpectedNoise(planted.spec, campaign, planted.truth);
  const Visibility v =
      Assess(scene, noise, planted.measured.counts, Contribution(scene, planted.truth, effect));
  const double scale = LambdaScale(effect);
  Json out;
  out["cause"] = effect.kind->cause;
  out["foreign"] = IsForeign(*effect.kind);
  out["axis"] = NameOfAxis(effect);
  out["scope"] = NameOf(effect.owner);
  out["scope_also"] = AlsoScope(effect);
  out["units"] = UnitsOf(campaign, effect);
  out["size"] = effect.kind->typical * effect.size;
  out["size_unit"] = effect.kind->amplitude_unit;
  out["shape"] = effect.shape;
  out["lambda_wanted"] = lambda_wanted * scale;
  out["lambda"] = v.lambda;
  out["lambda_per_freedom"] = v.lambda / scale;
  out["survival"] = v.survival;
  out["rms_um"] = v.rms_um;
  out["rms_left_um"] = v.rms_left_um;
  const auto columns = OptionalColumns(planted.spec);
  Json missing = Json::array();
  for (const std::string_view need : effect.kind->columns)
    if (std::find(columns.begin(), columns.end(), need) == columns.end()) missing.push_back(need);
  out["missing_columns"] = missing;
  Json rivals = Json::array();
  Json equivalent = Json::array();
  Json inseparable = Json::array();
  for (const Rival& rival : FindRivals(scene, noise, planted.measured.counts, effect)) {
    const double distance = v.lambda * (1 - rival.cosine * rival.cosine);
    rivals.push_back({{"cause", rival.cause}, {"cosine", rival.cosine}, {"distance", distance}});
    if (rival.cosine > 0.995) equivalent.push_back(rival.cause);
    if (rival.cosine <= 0.995 && distance < 21.6) inseparable.push_back(rival.cause);
  }
  out["equivalent"] = equivalent;    // no data of these moves could separate them
  out["inseparable"] = inseparable;  // data of this noise cannot, with 1 % confusion
  out["rivals"] = rivals;
  if (IsForeign(*effect.kind)) out["covariates"] = ForeignCovariates(effect.kind->cause);
  return out;
}

Json StaticJson(const Planted& planted) {
  const StaticErrors& e = planted.spec.static_errors;
  const NoiseModel noise = ExpectedNoise(planted.spec, planted.campaign, planted.truth);
  const StaticVisibility v =
      AssessStatic(planted.campaign, planted.truth, noise, planted.measured.counts);
  return {{"planted", e.base_um > 0 || e.arm_um > 0 || e.zero_deg > 0},
          {"base_um", e.base_um},
          {"arm_um", e.arm_um},
          {"zero_deg", e.zero_deg},
          {"lambda",
           {{"base_offset", v.base_offset},
            {"arm_length", v.arm_length},
            {"zero_offset", v.zero_offset}}}};
}

Json NuisanceJson(const Planted& planted) {
  const Nuisances& n = planted.spec.nuisances;
  return {{"outlier_share", n.outlier_share},
          {"missing_share", n.missing_share},
          {"missing_cells", n.missing_cells},
          {"tail_freedom", n.tail_freedom},
          {"unit_spread", n.unit_spread},
          {"picture_spread", n.picture_spread},
          {"turbulence_um", n.turbulence_um},
          {"turbulence_memory", n.turbulence_memory},
          {"night_shift_um", n.night_shift_um},
          {"wrapped_units", n.wrapped_units},
          {"troubled_units", planted.measured.troubled_unit_ids}};
}

std::vector<std::vector<Place>> Together(const Planted& planted, const Scene& scene) {
  std::vector<Effect> moving;
  for (const Effect& effect : planted.effects)
    if (effect.kind->cause != "sensor_bias") moving.push_back(effect);
  const auto units = AllUnits(planted.campaign);
  auto um = RunPlant(scene, planted.truth, moving, units);
  const auto without = RunPlant(scene, planted.truth, {}, units);
  for (std::size_t u = 0; u < um.size(); ++u)
    for (std::size_t m = 0; m < um[u].size(); ++m) um[u][m] = 1000.0 * (um[u][m] - without[u][m]);
  return um;
}

void AppendContribution(const Campaign& campaign, const Effect& effect,
                        const std::vector<std::vector<Place>>& um, std::string* text) {
  std::array<char, 128> line{};
  for (std::size_t m = 0; m < campaign.move_count(); ++m)
    for (std::size_t u = 0; u < campaign.unit_count(); ++u) {
      if (um[u].empty()) continue;
      std::snprintf(line.data(), line.size(), "%d,%zu,%s,%.4f,%.4f\n", campaign.units[u].id, m + 1,
                    std::string(effect.kind->cause).c_str(), um[u][m].real(), um[u][m].imag());
      *text += line.data();
    }
}

}  // namespace

Planted Plant(const Spec& spec) {
  Planted planted;
  planted.spec = spec;
  planted.campaign = MakeCampaign(spec.design, spec.seed);
  planted.truth = DrawTruth(spec, planted.campaign);
  const Scene scene = MakeScene(planted.campaign, planted.spec.physics);
  const NoiseModel noise = ExpectedNoise(spec, planted.campaign, planted.truth);
  const auto seen = Exposed(planted.campaign);
  Rng rng = Rng::Stream(spec.seed, "effects");
  for (std::size_t i = 0; i < spec.causes.size(); ++i) {
    planted.effects.push_back(DrawEffect(*FindKind(spec.causes[i]), planted.campaign, &rng));
  }
  for (std::size_t i = 0; i < spec.causes.size(); ++i) {
    Effect& effect = planted.effects[i];
    // A sensor's bias is seen through the arms' growth, and is tuned after the growth.
    if (effect.kind->cause == "sensor_bias") continue;
    Tune(scene, planted.truth, noise, seen, spec.lambda_wanted[i] * LambdaScale(effect), &effect);
  }
  for (std::size_t i = 0; i < spec.causes.size(); ++i) {
    Effect& bias = planted.effects[i];
    if (bias.kind->cause != "sensor_bias") continue;
    for (const Effect& effect : planted.effects)
      if (effect.kind->cause == "thermal_arm_growth")
        bias.read_through = effect.kind->typical * effect.size;
    Tune(scene, planted.truth, noise, seen, spec.lambda_wanted[i] * LambdaScale(bias), &bias);
  }
  planted.measured = Measure(spec, scene, planted.truth, planted.effects);
  return planted;
}

Key MakeKey(const Planted& planted) {
  const Scene scene = MakeScene(planted.campaign, planted.spec.physics);
  const Spec& spec = planted.spec;
  Json out;
  out["campaign_seed"] = spec.seed;
  out["kind"] = spec.kind;
  out["class"] = spec.dirty ? "dirty" : "clean";
  out["design"] = spec.design.design;
  out["units"] = planted.campaign.unit_count();
  out["moves"] = planted.campaign.move_count();
  out["columns"] = OptionalColumns(spec);
  out["dropped"] = spec.dropped;
  Key key;
  key.contribution_csv = "unit_id,move_id,cause,dx_um,dy_um\n";
  out["effects"] = Json::array();
  for (std::size_t i = 0; i < planted.effects.size(); ++i) {
    const Effect& effect = planted.effects[i];
    out["effects"].push_back(EffectJson(planted, scene, effect, spec.lambda_wanted[i]));
    AppendContribution(planted.campaign, effect, Contribution(scene, planted.truth, effect),
                       &key.contribution_csv);
  }
  out["also_true"] = planted.measured.also_true;
  out["static"] = StaticJson(planted);
  out["nuisances"] = NuisanceJson(planted);
  out["noise"] = {{"centroid_um", spec.centroid_um}, {"actuation_um", spec.actuation_um}};
  const OracleGain gain = AskOracle(planted.campaign, planted.measured, Together(planted, scene));
  out["oracle"] = {{"rms_before_um", gain.rms_before_um},
                   {"rms_after_um", gain.rms_after_um},
                   {"mad_before_um", gain.mad_before_um},
                   {"mad_after_um", gain.mad_after_um},
                   {"rows", gain.rows}};
  key.json = out.dump(1) + "\n";
  return key;
}

}  // namespace focalfleet::hidden
