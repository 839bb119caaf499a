// Effects of the firmware, the bus and the gear ratio on a command. The firmware counts steps from
// its believed position, so that a lost step stays lost until the next homing.
#include <algorithm>
#include <cmath>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/along_track.h"

namespace focalfleet::hidden {

namespace {

// The gear has another number of teeth, or a little more travel per revolution, than the model's.
void GearScale(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double ratio = 1 / (1 - effect.Amount(unit));
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t) { return (ratio - 1) * TravelOf(row, effect.axis); }, track);
}

// Microsteps are too long in one direction of rotation and too short in the other.
void Asymmetry(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double share = effect.Amount(unit);
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t) { return share * std::abs(TravelOf(row, effect.axis)); },
      track);
}

// The ramps travel too far; a move too short to reach full speed has a shorter ramp.
void RampTravel(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double extra_deg = effect.Amount(unit);
  const double ramps_deg = 0.2 + 0.4 * effect.shape[0];
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t) {
        const double travel = TravelOf(row, effect.axis);
        return std::copysign(extra_deg * std::min(1.0, std::abs(travel) / ramps_deg), travel);
      },
      track);
}

// Angles are sent in whole units of the least significant bit.
void Quantisation(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double wanted_deg = std::abs(effect.Amount(unit));
  if (wanted_deg <= 0) return;
  // Real steps are round numbers: hundredths of a degree, or powers of two of a turn.
  const double hundredths = std::max(1.0, std::round(wanted_deg / 0.01)) * 0.01;
  const double binary = 360 / std::exp2(std::round(std::log2(360 / wanted_deg)));
  const double step_deg = effect.shape[0] < 0.5 ? hundredths : binary;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const double cmd_deg = scene.campaign->At(m, unit).cmd_deg[effect.axis];
    const double steps = cmd_deg / step_deg;
    const double whole = effect.shape[1] < 0.5 ? std::round(steps) : std::floor(steps);
    track->angle_deg[effect.axis][m] += whole * step_deg - cmd_deg;
  }
}

// Whole revolutions of the rotor are lost where the drive's torque hardly exceeds the load. The
// odds rise as the voltage falls and the grease stiffens.
void StepLoss(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double rate = std::abs(effect.Amount(unit));
  const Campaign& campaign = *scene.campaign;
  const double turn_deg = 360 / campaign.units[unit].gear[effect.axis];
  Rng rng = Rng::Stream(effect.seed, "slips", unit);
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t m) {
        const double v = row.v_bus_V * campaign.exposures[m].drive_amplitude / campaign.v_nominal_V;
        const double stiff = std::exp(-0.03 * (row.temp_C - campaign.temp_mean_C));
        const double margin = 1.6 * v / stiff - 1;
        const double odds = rate * std::exp(-4 * (margin - 0.6));
        const double lot = rng.Uniform();
        if (lot > odds / (1 + odds)) return 0.0;
        const double turns = lot < 0.2 * odds / (1 + odds) ? 2 : 1;
        return -std::copysign(turns * turn_deg, TravelOf(row, effect.axis));
      },
      track);
}

// A frame is lost and the unit stays, or a frame is repeated and the unit goes twice as far.
void LostCommand(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double rate = std::abs(effect.Amount(unit));
  const double doubled = 0.3 * effect.shape[0];
  Rng rng = Rng::Stream(effect.seed, "frames", unit);
  std::array<double, kAxes> sum_deg{};
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const Row& row = scene.campaign->At(m, unit);
    if (row.rehomed) sum_deg = {};
    const double lot = rng.Uniform();
    const bool again = rng.Uniform() < doubled;
    for (std::size_t a = 0; a < kAxes; ++a) {
      if (lot < rate) sum_deg[a] += again ? TravelOf(row, a) : -TravelOf(row, a);
      track->angle_deg[a][m] += sum_deg[a];
    }
  }
}

}  // namespace

std::vector<EffectKind> TravelEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"gear_scale",
       Stage::kTravel,
       AxisUse::kEither,
       5e-4,
       "1",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       GearScale},
      {"scale_asymmetry",
       Stage::kTravel,
       AxisUse::kEither,
       2e-5,
       "1",
       200,
       true,
       mechanical,
       {},
       1,
       false,
       Asymmetry},
      {"ramp_travel",
       Stage::kTravel,
       AxisUse::kEither,
       0.01,
       "deg",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       RampTravel},
      {"command_quantisation",
       Stage::kTravel,
       AxisUse::kEither,
       0.08,
       "deg",
       20,
       false,
       {Owner::kUnit, Owner::kPlate},
       {},
       1,
       false,
       Quantisation},
      {"step_loss",
       Stage::kTravel,
       AxisUse::kEither,
       0.01,
       "slips per move",
       60,
       false,
       {Owner::kUnit},
       {},
       1,
       true,
       StepLoss},
      {"lost_command",
       Stage::kTravel,
       AxisUse::kNone,
       0.01,
       "per move",
       10,
       false,
       {Owner::kUnit, Owner::kBus},
       {},
       1,
       true,
       LostCommand},
  };
}

}  // namespace focalfleet::hidden
