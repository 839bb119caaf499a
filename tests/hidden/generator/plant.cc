#include "tests/hidden/generator/plant.h"

#include <cmath>
#include <numeric>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/curves.h"
#include "tests/hidden/generator/layout.h"

namespace focalfleet::hidden {

namespace {

// The other of the two units whose fibres are exchanged.
std::size_t PartnerOf(const Effect& swap, std::size_t unit) {
  for (std::size_t o = 0; o < swap.weight.size(); ++o)
    if (o != unit && swap.weight[o] == swap.weight[unit]) return o;
  return unit;
}

// The place errors of an axis that comes to rest anew: larger after long moves, and not alike in
// all units. Bearings tilt with either axis, so that the fibre is off in any direction.
void AddScatterOfBearings(const Campaign& campaign, const Truth& truth, std::size_t unit,
                          Track* track) {
  const Geometry& arms = truth.geometry[unit];
  Rng rng = Rng::Stream(truth.seed, "bearings", unit);
  const double of_unit = std::exp(0.3 * rng.Normal());
  Place held_mm;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    double square_mm2 = 0;
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (!row.Moved(a) && !row.rehomed) continue;
      const double travel_deg = std::abs(row.cmd_deg[a] - row.from_deg[a]);
      const double sigma_mm = truth.actuation_sigma_deg[a] * kDegree * arms.arm_mm[a];
      square_mm2 += sigma_mm * sigma_mm * (0.5 + 0.5 * std::min(2.0, travel_deg / 60));
    }
    if (square_mm2 > 0)
      held_mm = of_unit * std::sqrt(square_mm2 / 2) * Place(rng.Normal(), rng.Normal());
    track->place_mm[m] += held_mm;
  }
}

void AddScatter(const Campaign& campaign, const Truth& truth, std::size_t unit, Track* track) {
  for (std::size_t a = 0; a < kAxes; ++a) {
    if (truth.actuation_sigma_deg[a] <= 0) continue;
    Rng rng = Rng::Stream(truth.seed, a == kTheta ? "scatter theta" : "scatter phi", unit);
    double held_deg = 0;
    for (std::size_t m = 0; m < campaign.move_count(); ++m) {
      const Row& row = campaign.At(m, unit);
      if (row.Moved(a) || row.rehomed) held_deg = truth.actuation_sigma_deg[a] * rng.Normal();
      track->angle_deg[a][m] += held_deg;
    }
  }
}

// The arm of a leaning axis, as seen along the plate's normal. A turn by `lean` about an axis in
// the plate takes (1 - cos) of the part perpendicular to that axis away.
Place Foreshortened(const Place& arm, const Place& lean) {
  const double angle = std::abs(lean);
  if (angle <= 0) return arm;
  const Place along = lean / angle;  // unit vector perpendicular to the axis of the turn
  const double across = (std::conj(along) * arm).real();
  return arm - (1 - std::cos(angle)) * across * along;
}

void PlaceFibre(const Geometry& geometry, Track* track) {
  for (std::size_t m = 0; m < track->place_mm.size(); ++m) {
    const ByAxis angle{track->angle_deg[kTheta][m], track->angle_deg[kPhi][m]};
    Geometry grown = geometry;
    for (std::size_t a = 0; a < kAxes; ++a) grown.arm_mm[a] *= 1 + track->growth[a][m];
    const Place fibre = FibreAt(grown, angle);
    const Place lean{track->tilt_rad[0][m], track->tilt_rad[1][m]};
    track->place_mm[m] =
        lean == Place() ? fibre : geometry.base_mm + Foreshortened(fibre - geometry.base_mm, lean);
  }
}

ApplyEffect LawOf(const Scene& scene, const Effect& effect) {
  const ApplyEffect curve =
      scene.physics == Physics::kCurves ? CurveOf(effect.kind->cause) : nullptr;
  return curve != nullptr ? curve : effect.kind->apply;
}

std::vector<Place> RunUnit(const Scene& scene, const Truth& truth, std::span<const Effect> effects,
                           std::size_t unit) {
  const Campaign& campaign = *scene.campaign;
  const std::size_t moves = campaign.move_count();
  Track track;
  for (std::size_t a = 0; a < kAxes; ++a) {
    track.angle_deg[a].resize(moves);
    track.growth[a].assign(moves, 0);
    track.tilt_rad[a].assign(moves, 0);
    for (std::size_t m = 0; m < moves; ++m) track.angle_deg[a][m] = campaign.At(m, unit).cmd_deg[a];
  }
  track.place_mm.resize(moves);
  const auto apply = [&](Stage stage) {
    for (const Effect& effect : effects)
      if (effect.kind->stage == stage && effect.size != 0 && effect.weight[unit] != 0)
        LawOf(scene, effect)(scene, effect, unit, &track);
  };
  for (const Stage stage :
       {Stage::kTravel, Stage::kRest, Stage::kHistory, Stage::kGear, Stage::kExposure})
    apply(stage);
  const bool is_of_bearings = scene.physics == Physics::kCurves && truth.seed % 2 == 0;
  if (!is_of_bearings) AddScatter(campaign, truth, unit, &track);
  PlaceFibre(truth.geometry[unit], &track);
  if (is_of_bearings) AddScatterOfBearings(campaign, truth, unit, &track);
  apply(Stage::kPlate);
  apply(Stage::kCamera);
  return std::move(track.place_mm);
}

}  // namespace

Truth Believed(const Campaign& campaign) {
  Truth truth;
  for (const Unit& unit : campaign.units) truth.geometry.push_back(unit.believed);
  return truth;
}

Scene MakeScene(const Campaign& campaign, Physics physics) {
  return {&campaign, physics, Neighbours(campaign)};
}

std::vector<std::size_t> AllUnits(const Campaign& campaign) {
  std::vector<std::size_t> units(campaign.unit_count());
  std::iota(units.begin(), units.end(), std::size_t{0});
  return units;
}

std::vector<std::vector<Place>> RunPlant(const Scene& scene, const Truth& truth,
                                         std::span<const Effect> effects,
                                         std::span<const std::size_t> units) {
  std::vector<std::vector<Place>> places;
  places.reserve(units.size());
  for (const std::size_t unit : units) {
    std::size_t seen_as = unit;
    for (const Effect& effect : effects)
      if (effect.kind->cause == "identity_swap" && effect.size != 0 && effect.weight[unit] != 0)
        seen_as = PartnerOf(effect, unit);
    places.push_back(RunUnit(scene, truth, effects, seen_as));
  }
  return places;
}

}  // namespace focalfleet::hidden
