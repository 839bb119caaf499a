// Effects that no library holds: each has a covariate in which an analyst can see it, and none has
// a cause that could be named.
#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

namespace {

template <class Error>
void AddAngle(const Scene& scene, const Effect& effect, const Error& error, Track* track,
              std::size_t unit) {
  const double amount_deg = effect.Amount(unit);
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m)
    track->angle_deg[effect.axis][m] += amount_deg * error(m);
}

// A pump of the cooling shakes the units: a sawtooth in its phase.
void PumpSawtooth(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double start = effect.shape[0];
  AddAngle(
      scene, effect,
      [&](std::size_t m) {
        return 2 * std::fmod(campaign.exposures[m].pump_deg / 360 + start, 1.0) - 1;
      },
      track, unit);
}

// A distant source pulls all fibres around in a few hours.
void SlowTide(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double amount_mm = effect.Amount(unit);
  const double period_s = campaign.exposures.back().t_s / (1.7 + 1.5 * effect.shape[0]);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double wave = 2 * kPi * (campaign.exposures[m].t_s / period_s + effect.shape[1]);
    track->place_mm[m] += amount_mm * Place(std::sin(wave), 0.6 * std::cos(wave));
  }
}

// A gear that is in no drawing: five bumps a turn, rounded off.
void OrderFive(const Scene&, const Effect& effect, std::size_t unit, Track* track) {
  const double amount_deg = effect.Amount(unit);
  const double order = effect.shape[0] < 0.5 ? 5.0 : 3.7;
  for (double& angle : track->angle_deg[effect.axis]) {
    const double wave = order * angle * kDegree + effect.phase_rad[unit];
    angle += amount_deg * std::sin(wave + 0.3 * std::sin(wave));
  }
}

void Humidity(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  AddAngle(
      scene, effect,
      [&](std::size_t m) {
        const double h = (scene.campaign->exposures[m].humidity - 50) / 20;
        return h + 0.3 * h * std::abs(h);
      },
      track, unit);
}

// Wind pushes the telescope aside, with the square of its speed.
void Wind(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double amount_mm = effect.Amount(unit);
  const Place towards = std::polar(1.0, 2 * kPi * effect.shape[0]);
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const double speed = scene.campaign->exposures[m].wind_m_s / 6;
    track->place_mm[m] += amount_mm * speed * speed * towards;
  }
}

// The arm's error depends on its pose before.
void Memory(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  AddAngle(
      scene, effect,
      [&](std::size_t m) {
        const double from_deg = campaign.At(m, unit).from_deg[effect.axis];
        return std::sin(2 * from_deg * kDegree + effect.phase_rad[unit]);
      },
      track, unit);
}

// A part bends in proportion to the square of the temperature's difference from the mean.
void QuadraticHeat(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  AddAngle(
      scene, effect,
      [&](std::size_t m) {
        const double t = (campaign.At(m, unit).temp_C - campaign.temp_mean_C) / 6;
        return t * t;
      },
      track, unit);
}

// The shutter opens from the left and from the right in turns.
void Shutter(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double amount_mm = effect.Amount(unit);
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m)
    track->place_mm[m] += amount_mm * (m % 2 == 0 ? 0.5 : -0.5) * Place(1, 0.2);
}

}  // namespace

std::vector<std::string_view> ForeignCovariates(std::string_view cause) {
  if (cause == "other_pump_sawtooth") return {"pump_deg"};
  if (cause == "other_slow_tide") return {"t_s", "move_id"};
  if (cause == "other_order_five") return {"theta", "phi", "order", "harmonic"};
  if (cause == "other_humidity") return {"humidity"};
  if (cause == "other_wind") return {"wind"};
  if (cause == "other_memory") return {"from", "previous"};
  if (cause == "other_quadratic_heat") return {"temp"};
  return {"move_id", "parity", "alternat"};
}

std::vector<EffectKind> ForeignEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"other_pump_sawtooth",
       Stage::kExposure,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       PumpSawtooth},
      {"other_slow_tide",
       Stage::kPlate,
       AxisUse::kNone,
       2e-3,
       "mm",
       60,
       true,
       {Owner::kPlate},
       {},
       1,
       false,
       SlowTide},
      {"other_order_five",
       Stage::kGear,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       false,
       mechanical,
       {},
       2,
       false,
       OrderFive},
      {"other_humidity",
       Stage::kExposure,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       Humidity},
      {"other_wind",
       Stage::kPlate,
       AxisUse::kNone,
       2e-3,
       "mm",
       60,
       true,
       {Owner::kPlate},
       {},
       1,
       false,
       Wind},
      {"other_memory",
       Stage::kExposure,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       true,
       mechanical,
       {},
       2,
       false,
       Memory},
      {"other_quadratic_heat",
       Stage::kExposure,
       AxisUse::kEither,
       0.02,
       "deg",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       QuadraticHeat},
      {"other_shutter",
       Stage::kPlate,
       AxisUse::kNone,
       3e-3,
       "mm",
       60,
       true,
       {Owner::kPlate},
       {},
       1,
       false,
       Shutter},
  };
}

}  // namespace focalfleet::hidden
