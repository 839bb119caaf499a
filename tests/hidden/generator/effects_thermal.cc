// Effects of heat. Nothing follows a sensor at once: arms, plate and motors have thermal masses,
// integrated in time between the exposures.
#include <algorithm>
#include <cmath>

#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

namespace {

// A thermal mass follows the temperature of its surroundings. The integral is exact for
// surroundings that change linearly between two exposures.
class ThermalMass {
 public:
  ThermalMass(double start_C, double tau_s) : at_C_(start_C), before_C_(start_C), tau_s_(tau_s) {}
  double Step(double around_C, double dt_s) {
    if (dt_s > 0) {
      const double slope = (around_C - before_C_) / dt_s;
      const double fade = std::exp(-dt_s / tau_s_);
      at_C_ = around_C - slope * tau_s_ + (at_C_ - before_C_ + slope * tau_s_) * fade;
    }
    before_C_ = around_C;
    return at_C_;
  }

 private:
  double at_C_;
  double before_C_;
  double tau_s_;
};

double Since(const Campaign& campaign, std::size_t move) {
  return move == 0 ? 0 : campaign.exposures[move].t_s - campaign.exposures[move - 1].t_s;
}

// Grease stiffens in the cold by an Andrade law, and the shaft's wind-up grows with it. The
// firmware corrects for the wind-up at the mean temperature.
void ThermalBacklash(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const auto direction = Directions(campaign, unit, effect.axis);
  const double per_kelvin_deg = effect.Amount(unit);
  const double activation_K = 1500 + 1500 * effect.shape[0];
  const double mean_K = campaign.temp_mean_C + 273.15;
  const double slope_per_K = activation_K / mean_K / mean_K;
  double held = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    if (row.Moved(effect.axis) || row.rehomed) {
      const double stiff = std::exp(activation_K * (1 / (row.temp_C + 273.15) - 1 / mean_K));
      held = (stiff - 1) / slope_per_K;
    }
    track->angle_deg[effect.axis][m] -= direction[m] * per_kelvin_deg * held;
  }
}

void ThermalArmGrowth(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double per_kelvin = effect.Amount(unit);
  const double tau_s = 60 + 240 * effect.shape[0];
  ThermalMass arm(campaign.At(0, unit).temp_C, tau_s);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double at_C = arm.Step(campaign.At(m, unit).temp_C, Since(campaign, m));
    for (std::size_t a = 0; a < kAxes; ++a)
      track->growth[a][m] += per_kelvin * (at_C - campaign.temp_mean_C);
  }
}

// The motor's losses warm its winding, the winding its housing, and the housing turns the axis.
void SelfHeating(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double amount_deg = effect.Amount(unit);
  const double housing_s = 100 + 400 * effect.shape[0];
  const double winding_s = 15;
  double winding = 0;
  double housing = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    const double drive = campaign.exposures[m].drive_amplitude;
    const double heat =
        std::abs(row.cmd_deg[effect.axis] - row.from_deg[effect.axis]) / 100 * drive * drive;
    const double dt_s = Since(campaign, m);
    for (double left = dt_s; left > 0; left -= 2) {  // Euler, far below both constants
      const double step = std::min(2.0, left);
      const double flow = winding / winding_s;
      winding -= flow * step;
      housing += (flow - housing / housing_s) * step;
      if (winding < 1e-9 && housing < 1e-9) break;
    }
    winding += heat;
    track->angle_deg[effect.axis][m] += amount_deg * (housing + 0.2 * winding);
  }
}

void PlateExpansion(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double per_kelvin = effect.Amount(unit);
  ThermalMass plate(campaign.exposures[0].air_C, 200 + 400 * effect.shape[0]);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double at_C = plate.Step(campaign.exposures[m].air_C, Since(campaign, m));
    track->place_mm[m] += per_kelvin * (at_C - campaign.temp_mean_C) * track->place_mm[m];
  }
}

// A plate is warmer on one side, and free of stress. The strain is the same in all directions and
// proportional to g.x. The displacement is then conj(g) z^2 / 2 in complex notation.
void PlateGradient(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double per_kelvin = effect.Amount(unit);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Place z = track->place_mm[m];
    track->place_mm[m] +=
        0.5 * per_kelvin * std::conj(campaign.exposures[m].gradient_C_per_mm) * z * z;
  }
  static_cast<void>(unit);
}

// A board reports another temperature than it has, and no arm moves for it. An analyst sees what is
// left when the arms' true growth is computed from the reported temperature.
void SensorBias(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double gain = effect.Amount(unit);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double off_C = gain * (campaign.At(m, unit).temp_C - campaign.temp_mean_C);
    for (std::size_t a = 0; a < kAxes; ++a) track->growth[a][m] -= effect.read_through * off_C;
  }
}

}  // namespace

std::vector<EffectKind> ThermalEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"thermal_backlash",
       Stage::kHistory,
       AxisUse::kEither,
       2e-3,
       "deg per K",
       60,
       false,
       mechanical,
       {"temp_C"},
       1,
       false,
       ThermalBacklash},
      {"thermal_arm_growth",
       Stage::kExposure,
       AxisUse::kNone,
       23e-6,
       "per K",
       40,
       true,
       mechanical,
       {"temp_C"},
       1,
       false,
       ThermalArmGrowth},
      {"self_heating",
       Stage::kExposure,
       AxisUse::kEither,
       0.02,
       "deg per 100 deg of travel",
       40,
       true,
       mechanical,
       {"t_s"},
       1,
       false,
       SelfHeating},
      {"plate_expansion",
       Stage::kPlate,
       AxisUse::kNone,
       5e-6,
       "per K",
       60,
       true,
       {Owner::kPlate},
       {"temp_C"},
       1,
       false,
       PlateExpansion},
      {"plate_gradient",
       Stage::kPlate,
       AxisUse::kNone,
       2e-5,
       "per K",
       60,
       true,
       {Owner::kPlate},
       {"temp_C"},
       1,
       false,
       PlateGradient},
      {"sensor_bias",
       Stage::kExposure,
       AxisUse::kNone,
       0.1,
       "gain",
       20,
       true,
       {Owner::kRail},
       {"temp_C"},
       1,
       false,
       SensorBias},
  };
}

}  // namespace focalfleet::hidden
