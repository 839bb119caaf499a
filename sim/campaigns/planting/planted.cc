#include "sim/campaigns/planting/planted.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/model/model.h"
#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/planting/planted_faults.h"

namespace focalfleet::sim {
namespace {

constexpr double kPitch_mm = 25.6;
constexpr double kArm_mm = 8.25;
constexpr std::size_t kUnitsPerRail = 50;
constexpr std::size_t kUnitsPerBus = 100;

void LayHexagon(const PlantedOptions& options, Campaign* campaign) {
  struct Place {
    double r2, x, y;
  };
  std::vector<Place> places;
  const int reach = static_cast<int>(std::sqrt(static_cast<double>(options.units))) + 3;
  for (int row = -reach; row <= reach; ++row)
    for (int column = -reach; column <= reach; ++column) {
      const double x = kPitch_mm * (column + 0.5 * (row & 1));
      const double y = kPitch_mm * std::sqrt(3.0) / 2 * row;
      places.push_back({x * x + y * y, x, y});
    }
  std::stable_sort(places.begin(), places.end(),
                   [](const Place& a, const Place& b) { return a.r2 < b.r2; });
  const double gear = options.pinion ? 337.36 * 45 / 17 : 337.36;
  for (std::size_t u = 0; u < options.units; ++u) {
    CampaignUnit unit;
    unit.id = static_cast<std::uint32_t>(u + 1);
    unit.base_x_mm = places[u].x, unit.base_y_mm = places[u].y;
    for (const std::size_t axis : {kTheta, kPhi}) {
      unit.arm_mm[axis] = kArm_mm;
      unit.gear[axis] = gear;
    }
    unit.min_deg[kTheta] = -190, unit.max_deg[kTheta] = 190;
    unit.min_deg[kPhi] = 0, unit.max_deg[kPhi] = 180;
    unit.rail = static_cast<double>(u / kUnitsPerRail);
    unit.rail_slot = static_cast<double>(u % kUnitsPerRail);
    unit.bus = static_cast<double>(u / kUnitsPerBus);
    unit.bus_slot = static_cast<double>(u % kUnitsPerBus);
    campaign->units.push_back(unit);
  }
}

// Conditions of one exposure, the same for all units.
struct Exposure {
  double movers_share, delay_s, drive, temperature_C, elevation_deg, v_bus_V, time_s;
};

std::vector<Exposure> DrawExposures(const PlantedOptions& options) {
  Rng rng = Rng::Stream(options.seed, "exposures");
  std::vector<Exposure> exposures;
  double time_s = 0;
  constexpr double kShares[] = {1, 1, 0.5, 0.25};
  constexpr double kDelays_s[] = {0.3, 1, 3, 10, 30};
  constexpr double kDrives[] = {0.6, 1, 1, 1.5};
  for (std::size_t m = 0; m < options.moves; ++m) {
    time_s += rng.Uniform(30, 90);
    const double night = static_cast<double>(m) / static_cast<double>(options.moves);
    exposures.push_back({.movers_share = kShares[rng.Below(4)],
                         .delay_s = kDelays_s[rng.Below(5)],
                         .drive = kDrives[rng.Below(4)],
                         .temperature_C = 12 + 6 * std::sin(7 * night) + rng.Uniform(-2, 2),
                         .elevation_deg = rng.Uniform(20, 90),
                         .v_bus_V = 1.8 - 0.1 * night + rng.Uniform(-0.03, 0.03),
                         .time_s = time_s});
  }
  return exposures;
}

double NextAngle(Rng* rng, double from, double low, double high) {
  // Long moves anywhere, and a ladder of short ones both ways.
  constexpr double kLadder_deg[] = {0.15, 0.3, 0.6, 1.5, 4, 12};
  if (rng->Uniform() < 0.5) return rng->Uniform(low, high);
  const double step = kLadder_deg[rng->Below(6)] * (rng->Uniform() < 0.5 ? -1 : 1);
  const double next = from + step;
  return next < low || next > high ? from - step : next;
}

struct Columns {
  std::vector<double>*time, *sigma, *temperature, *volts, *elevation, *movers, *delay, *drive,
      *rehomed, *cycles[2];
};

Columns MakeColumns(Campaign* campaign) {
  const char* names[] = {"t_s",           "sigma_um",       "temp_C",    "v_bus_V",
                         "elevation_deg", "movers_on_rail", "delay_s",   "drive_amplitude",
                         "rehomed",       "cycles_theta",   "cycles_phi"};
  for (const char* name : names) campaign->covariates.push_back({name, {}});
  auto& c = campaign->covariates;
  return {&c[0].values, &c[1].values, &c[2].values, &c[3].values, &c[4].values,
          &c[5].values, &c[6].values, &c[7].values, &c[8].values, {&c[9].values, &c[10].values}};
}

void DrawMoves(const PlantedOptions& options, Campaign* campaign) {
  const std::vector<Exposure> exposures = DrawExposures(options);
  const Columns columns = MakeColumns(campaign);
  std::map<std::pair<double, std::size_t>, double> movers;
  std::vector<std::pair<double, std::size_t>> key;
  campaign->first_row.push_back(0);
  for (std::size_t u = 0; u < options.units; ++u) {
    Rng rng = Rng::Stream(options.seed, "moves", u);
    const CampaignUnit& unit = campaign->units[u];
    double q[2] = {rng.Uniform(-90, 90), rng.Uniform(30, 150)};
    double cycles[2] = {rng.Uniform(0, 5000), rng.Uniform(0, 5000)};
    for (std::size_t m = 0; m < options.moves; ++m) {
      const Exposure& e = exposures[m];
      const bool moves = rng.Uniform() < e.movers_share;
      const double which = rng.Uniform();
      campaign->move_id.push_back(static_cast<std::int64_t>(m + 1));
      columns.rehomed->push_back(rng.Uniform() < options.homing_share ? 1 : 0);
      for (const std::size_t axis : {kTheta, kPhi}) {
        const bool turns = moves && (which < 0.6 || (which < 0.8) == (axis == kTheta));
        double to = NextAngle(&rng, q[axis], axis == kTheta ? -180 : unit.min_deg[axis] + 2,
                              axis == kTheta ? 180 : unit.max_deg[axis] - 2);
        if (!turns) to = q[axis];
        campaign->from_deg[axis].push_back(q[axis]);
        campaign->cmd_deg[axis].push_back(to);
        cycles[axis] += std::abs(to - q[axis]) / 360;
        columns.cycles[axis]->push_back(cycles[axis]);
        q[axis] = to;
      }
      key.emplace_back(unit.rail, m);
      movers[key.back()] += moves ? 1 : 0;
      columns.time->push_back(e.time_s);
      columns.sigma->push_back(options.noise_um);
      columns.temperature->push_back(e.temperature_C + 0.3 * std::sin(static_cast<double>(u)));
      columns.volts->push_back(e.v_bus_V);
      columns.elevation->push_back(e.elevation_deg);
      columns.delay->push_back(e.delay_s);
      columns.drive->push_back(e.drive);
    }
    campaign->first_row.push_back(campaign->move_id.size());
  }
  for (const auto& k : key) columns.movers->push_back(movers[k]);
}

std::string LibrarysCauses() {
  std::string names;
  for (const Effect& effect : EffectLibrary())
    names += (names.empty() ? "" : ", ") + std::string(effect.cause);
  return names;
}

Result<ModelTerm> TermOf(const PlantedEffect& planted, const CampaignFacts& facts,
                         std::uint64_t seed) {
  const Effect* effect = FindEffect(planted.cause);
  if (effect == nullptr)
    return Fail(ErrorCode::kInvalid,
                "there is no effect '" + planted.cause + "'; there are " + LibrarysCauses());
  ModelTerm term;
  Templates templates = ListTemplates(*effect, facts);
  if (!planted.axis.empty())
    std::erase_if(templates, [&](const Template& one) { return Name(one.axis) != planted.axis; });
  if (templates.empty())
    return Fail(ErrorCode::kInvalid, planted.cause + ": not on axis '" + planted.axis + "' here");
  if (planted.form >= std::ssize(templates)) {
    std::string shapes;
    for (std::size_t k = 0; k < templates.size(); ++k)
      shapes += "\n  " + std::to_string(k) + "  " + std::string(Name(templates[k].axis)) + ": " +
                templates[k].label;
    return Fail(ErrorCode::kInvalid, planted.cause + ": no shape " + std::to_string(planted.form) +
                                         "; there are" + shapes);
  }
  term.form = templates[static_cast<std::size_t>(std::max(planted.form, 0))];
  const std::size_t units = facts.campaign->units.size();
  Rng rng = Rng::Stream(seed, planted.cause);
  term.sharing = Sharing::kUnit;
  const std::size_t c = term.form.columns;
  const bool of_all = effect->owner == Owner::kPlate || effect->owner == Owner::kCamera;
  double phase = 0;
  // A step of rounding belongs to the controller. Shapes with values between the listed ones are
  // units' own.
  const bool own = effect->own_shape && effect->continuous_shape && planted.form < 0;
  std::map<std::uint32_t, double> shapes;
  std::erase_if(templates, [&](const Template& one) { return one.form != term.form.form; });
  for (std::size_t u = 0; u < units; ++u) {
    const bool has = planted.unit_share >= 1 || rng.Uniform() < planted.unit_share ||
                     (u + 1 == units && planted.unit_share > 0 &&
                      std::all_of(term.group_of_unit.begin(), term.group_of_unit.end(),
                                  [](std::uint32_t g) { return g == kNoGroup; }));
    term.group_of_unit.push_back(has ? static_cast<std::uint32_t>(u) : kNoGroup);
    const double size = planted.amplitude * (1 + planted.unit_scatter * rng.Normal());
    const double drawn = rng.Uniform(0, 2 * std::numbers::pi);
    if (!of_all || u == 0) phase = drawn;  // a plate bends one way for all
    if (own) shapes[facts.campaign->units[u].id] = templates[rng.Below(templates.size())].shape;
    for (std::size_t k = 0; k < c; ++k)
      term.amplitude.push_back(c == 1   ? size
                               : k == 0 ? size * std::cos(phase)
                                        : size * std::sin(phase));
  }
  term.sigma.assign(term.amplitude.size(), 0);
  if (own) term.form = WithShapes(term.form, std::move(shapes));
  return term;
}

CampaignModel TrueModel(const PlantedOptions& options, const Campaign& campaign) {
  CampaignModel model;
  model.units = campaign.units;
  for (std::size_t u = 0; u < model.units.size(); ++u) {
    Rng rng = Rng::Stream(options.seed, "geometry", u);
    CampaignUnit& unit = model.units[u];
    unit.base_x_mm += options.base_offset_mm * rng.Normal();
    unit.base_y_mm += options.base_offset_mm * rng.Normal();
    for (const std::size_t axis : {kTheta, kPhi}) {
      unit.zero_deg[axis] += options.zero_offset_deg * rng.Normal();
      unit.arm_mm[axis] += options.arm_offset_mm * rng.Normal();
    }
  }
  return model;
}

void Measure(const PlantedOptions& options, const CampaignFacts& facts, const Places& places,
             Campaign* campaign) {
  constexpr double kRadians = std::numbers::pi / 180;
  for (std::size_t u = 0; u < campaign->units.size(); ++u) {
    Rng rng = Rng::Stream(options.seed, "noise", u);
    const UnitTrack track = MakeTrack(facts, u, campaign->units[u]);
    double rest[2] = {0, 0};
    for (std::size_t i = 0; i < track.moves; ++i) {
      const std::size_t row = track.first_row + i;
      for (const std::size_t axis : {kTheta, kPhi})
        if (track.restarts[i] != 0 || track.step_deg[axis][i] != 0)
          rest[axis] = kRadians * options.rest_noise_deg * rng.Normal();
      const double a = rest[kTheta], b = rest[kPhi];
      const double ex = track.elbow_x_mm[i] + track.reach_x_mm[i];
      const double ey = track.elbow_y_mm[i] + track.reach_y_mm[i];
      double dx = -ey * a - track.reach_y_mm[i] * b + 1e-3 * options.noise_um * rng.Normal();
      double dy = ex * a + track.reach_x_mm[i] * b + 1e-3 * options.noise_um * rng.Normal();
      if (rng.Uniform() < options.outlier_share) dx += rng.Uniform(-2, 2), dy += rng.Uniform(-2, 2);
      campaign->x_mm[row] = places.x_mm[row] + dx;
      campaign->y_mm[row] = places.y_mm[row] + dy;
      if (rng.Uniform() < options.lost_share)
        campaign->x_mm[row] = campaign->y_mm[row] = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

bool IsByPixel(const PlantedEffect& planted) { return planted.cause == "centroid_bias"; }

// Changes of the places that depend on the camera's pixels.
Status PlantByPixel(const PlantedOptions& options, Campaign* campaign) {
  constexpr double kPixel_mm = 0.06, kMiddle = 1000;
  for (const auto& [name, place_mm] :
       {std::pair("pixel_x", &campaign->x_mm), {"pixel_y", &campaign->y_mm}}) {
    campaign->covariates.push_back({name, {}});
    for (const double at_mm : *place_mm)
      campaign->covariates.back().values.push_back(kMiddle + at_mm / kPixel_mm);
  }
  const CampaignFacts facts = MakeFacts(*campaign);
  CampaignModel plain;
  plain.units = campaign->units;
  CampaignModel model = plain;
  for (const PlantedEffect& planted : options.effects) {
    if (!IsByPixel(planted)) continue;
    FOCALFLEET_TRY_ASSIGN(ModelTerm term, TermOf(planted, facts, options.seed));
    model.terms.push_back(std::move(term));
  }
  const Places with = Predict(model, facts, OneAfterTheOther());
  const Places without = Predict(plain, facts, OneAfterTheOther());
  for (std::size_t row = 0; row < campaign->rows(); ++row) {
    campaign->x_mm[row] += with.x_mm[row] - without.x_mm[row];
    campaign->y_mm[row] += with.y_mm[row] - without.y_mm[row];
  }
  return {};
}

}  // namespace

Result<Campaign> PlantCampaign(const PlantedOptions& options) {
  Campaign campaign;
  campaign.name = "planted";
  LayHexagon(options, &campaign);
  DrawMoves(options, &campaign);
  campaign.x_mm.assign(campaign.rows(), 0);
  campaign.y_mm.assign(campaign.rows(), 0);
  if (!options.next.empty()) campaign = Ahead(campaign, options.next);
  const CampaignFacts facts = MakeFacts(campaign);
  CampaignModel model = TrueModel(options, campaign);
  for (const PlantedEffect& planted : options.effects) {
    if (IsByPixel(planted) || IsPlantedFault(planted.cause)) continue;
    FOCALFLEET_TRY_ASSIGN(ModelTerm term, TermOf(planted, facts, options.seed));
    model.terms.push_back(std::move(term));
  }
  Measure(options, facts, Predict(model, facts, OneAfterTheOther()), &campaign);
  for (const PlantedEffect& planted : options.effects)
    if (IsPlantedFault(planted.cause))
      FOCALFLEET_TRY(PlantFault(planted, facts, options.seed, &campaign));
  if (std::ranges::any_of(options.effects, IsByPixel))
    FOCALFLEET_TRY(PlantByPixel(options, &campaign));
  return campaign;
}

}  // namespace focalfleet::sim
