#include "tests/hidden/generator/curves.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/along_track.h"

namespace focalfleet::hidden {

namespace {

double DirectionOf(const Row& row, std::size_t axis) { return TravelOf(row, axis) > 0 ? 1 : -1; }

// A wave with a share of its second harmonic, as parts that are not ideal have it.
double Wave(double at_rad, double second, double second_at_rad) {
  return std::sin(at_rad) + second * std::sin(2 * at_rad + second_at_rad);
}

// ---- Travel.

// Most of the extra way is made in the first part of a ramp.
void RampTravel(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double ramp_deg = 0.1 + 0.5 * effect.shape[0];
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t) {
        return effect.Amount(unit) * std::tanh(TravelOf(row, effect.axis) / ramp_deg);
      },
      track);
}

// Angles are cut towards zero, to steps that are no round number.
void Quantisation(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double step_deg = std::abs(effect.Amount(unit));
  if (step_deg <= 0) return;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const double cmd_deg = scene.campaign->At(m, unit).cmd_deg[effect.axis];
    track->angle_deg[effect.axis][m] += std::trunc(cmd_deg / step_deg) * step_deg - cmd_deg;
  }
}

// Long moves lose a turn of the rotor more often than short ones.
void StepLoss(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double rate = std::abs(effect.Amount(unit));
  const double turn_deg = 360 / scene.campaign->units[unit].gear[effect.axis];
  Rng rng = Rng::Stream(effect.seed, "turns", unit);
  AddTravel(
      scene, effect, unit,
      [&](const Row& row, std::size_t) {
        const double travel = TravelOf(row, effect.axis);
        const double odds = 1 - std::exp(-rate * std::abs(travel) / 30);
        return rng.Uniform() < odds ? -std::copysign(turn_deg, travel) : 0.0;
      },
      track);
}

// ---- The rotor at rest.

// The field is a linear spring, and grease in the cold loads it more.
void LoadAngleLag(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double) {
        const Row& row = campaign.At(m, unit);
        const double cold = 1 - 0.004 * (row.temp_C - campaign.temp_mean_C);
        return -DirectionOf(row, effect.axis) * std::abs(effect.Amount(unit)) * cold /
               DriveOf(campaign, m, unit);
      },
      track);
}

void SupplyDrift(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double) {
        const Row& row = campaign.At(m, unit);
        const double low = (campaign.v_mean_V - row.v_bus_V) / campaign.v_mean_V;
        return -DirectionOf(row, effect.axis) * std::abs(effect.Amount(unit)) * low * (1 + low);
      },
      track);
}

// The feed alone has resistance: all slots of a rail miss nearly the same voltage.
void SupplyDroop(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const Unit& self = campaign.units[unit];
  double on_rail = 0;
  for (const Unit& other : campaign.units) on_rail += other.rail == self.rail ? 1 : 0;
  const double along = 1 + (0.2 + effect.shape[0]) * self.rail_slot / std::max(1.0, on_rail);
  const double drop_rad = std::abs(effect.Amount(unit)) * on_rail * along;
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    Effect of_axis = effect;
    of_axis.axis = axis;
    AddAtRest(
        scene, of_axis, unit,
        [&](std::size_t m, double) {
          const Row& row = campaign.At(m, unit);
          return -DirectionOf(row, axis) * drop_rad * std::pow(row.movers_on_rail / on_rail, 1.15);
        },
        track);
  }
}

// A detent is no pure sine: its flanks differ. A field twice as strong halves it.
void Cogging(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double order = effect.shape[0] < 0.2 ? 1 : effect.shape[0] < 0.6 ? 2 : 6;
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double rotor_rad) {
        return effect.Amount(unit) / DriveOf(*scene.campaign, m, unit) *
               Wave(order * rotor_rad + effect.phase_rad[unit], 0.15, 1);
      },
      track);
}

// Gain and offset of a phase at once: the first and the second harmonic of the field's angle.
void PhaseImbalance(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double of_gain = effect.shape[0], turn = effect.phase_rad[unit];
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double rotor_rad) {
        return effect.Amount(unit) *
               (of_gain * std::sin(2 * rotor_rad + turn) +
                (1 - of_gain) * std::sin(rotor_rad + 2 * turn) / DriveOf(*scene.campaign, m, unit));
      },
      track);
}

// The loss of short moves shrinks as they get longer.
void ModeThreshold(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double limit_deg = 2 + 18 * effect.shape[0];
  AddHeld(
      scene, effect, unit,
      [&](const Row& row, std::size_t) {
        const double travel = TravelOf(row, effect.axis);
        if (std::abs(travel) >= limit_deg) return 0.0;
        return -DirectionOf(row, effect.axis) * effect.Amount(unit) *
               (1 - 0.25 * std::abs(travel) / limit_deg);
      },
      track);
}

// ---- Gears, as measured.

void AddWave(const Effect& effect, std::size_t unit, double order, double size_deg, Track* track) {
  AddOfAngle(
      effect,
      [&](double at) {
        return size_deg * Wave(order * at + effect.phase_rad[unit], 0.12, 6 * effect.shape[1]);
      },
      track);
}

void Eccentricity(const Scene&, const Effect& effect, std::size_t unit, Track* track) {
  AddWave(effect, unit, 1, effect.Amount(unit) / kDegree, track);
}

void PinionRunout(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double order = HasSpur(scene, unit, effect.axis) ? kSpur : kStage;
  AddWave(effect, unit, order, effect.Amount(unit) / order / kDegree, track);
}

void StageRipple(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double stages = 1 + std::floor(2.999 * effect.shape[0]);
  const double order = (HasSpur(scene, unit, effect.axis) ? kSpur : 1) * std::pow(kStage, stages);
  AddWave(effect, unit, order, effect.Amount(unit) / kDegree, track);
}

// Each tooth is a parabola between two cusps.
void ToothMesh(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double order = HasSpur(scene, unit, effect.axis) ? 45 : 46;
  AddOfAngle(
      effect,
      [&](double at) {
        const double off =
            std::remainder(order * at + effect.phase_rad[unit], 2 * kPi) / kPi;  // -1..1
        return effect.Amount(unit) * (1 - 3 * off * off) / 2;
      },
      track);
}

// A chipped tooth drops at once and recovers slowly.
void ToothDamage(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double ratio = HasSpur(scene, unit, effect.axis) ? kSpur : 1;
  const double front_rad = (4 + 4 * effect.shape[0]) * kDegree;
  const double back_rad = (12 + 20 * effect.shape[0]) * kDegree;
  AddOfAngle(
      effect,
      [&](double at) {
        const double off = std::remainder(ratio * at - effect.phase_rad[unit], 2 * kPi);
        return effect.Amount(unit) *
               std::max(0.0, 1 - std::abs(off) / (off < 0 ? front_rad : back_rad));
      },
      track);
}

// The stop's rubber yields by the logarithm of the load.
void HardStop(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Unit& self = scene.campaign->units[unit];
  const std::size_t a = effect.axis;
  const bool upper = effect.shape[1] < 0.5;
  const double before_deg = 4 + 16 * effect.shape[0];
  const double contact_deg = upper ? self.max_deg[a] - before_deg : self.min_deg[a] + before_deg;
  constexpr double kSoft_deg = 1.5;
  AddOfAngle(
      effect,
      [&](double at) {
        const double into = upper ? at / kDegree - contact_deg : contact_deg - at / kDegree;
        const double back =
            effect.Amount(unit) * kSoft_deg * std::log1p(std::exp(into / kSoft_deg));
        return upper ? -back : back;
      },
      track);
}

// ---- The arm while it waits.

// Creep of polymers and grease goes with the logarithm of time.
void Relaxation(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const auto direction = Directions(campaign, unit, effect.axis);
  const double first_s = 0.3 + 2 * effect.shape[0];
  for (std::size_t m = 0; m < campaign.move_count(); ++m)
    track->angle_deg[effect.axis][m] -= direction[m] * effect.Amount(unit) *
                                        std::log1p(campaign.At(m, unit).delay_s / first_s) /
                                        std::log1p(100 / first_s);
}

// The gear train is a linear spring under the weight of the arm.
void GravityTorque(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const Geometry& geometry = campaign.units[unit].believed;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    const double first = (row.cmd_deg[kTheta] + geometry.zero_deg[kTheta]) * kDegree;
    const double second = first + (row.cmd_deg[kPhi] + geometry.zero_deg[kPhi]) * kDegree;
    const double lever =
        effect.axis == kPhi ? std::cos(second) : 0.8 * std::cos(first) + 0.2 * std::cos(second);
    track->angle_deg[effect.axis][m] -=
        effect.Amount(unit) / 2 * lever * std::cos(campaign.exposures[m].elevation_deg * kDegree);
  }
}

// The bundle pulls theta in proportion to phi's angle, a little less near the ends.
void AxisCrosstalk(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Unit& self = scene.campaign->units[unit];
  const double half_deg = (self.max_deg[kPhi] - self.min_deg[kPhi]) / 2;
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const double along = (track->angle_deg[kPhi][m] - self.min_deg[kPhi]) / half_deg - 1;
    track->angle_deg[kTheta][m] +=
        effect.Amount(unit) * half_deg * along * (1 - 0.2 * along * along);
  }
}

// Wear goes with the logarithm of the turns once the parts have run in.
void Wear(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const Row& first = campaign.At(0, unit);
  const double before = first.cycles[effect.axis] -
                        std::abs(first.cmd_deg[effect.axis] - first.from_deg[effect.axis]) / 360;
  const double run_in = 15 + 60 * effect.shape[0];
  for (std::size_t m = 0; m < campaign.move_count(); ++m)
    track->angle_deg[effect.axis][m] +=
        effect.Amount(unit) * run_in *
        std::log1p((campaign.At(m, unit).cycles[effect.axis] - before) / run_in);
}

// ---- Heat.

// The firmware corrects for the wind-up at the mean temperature; the rest is nearly linear.
void ThermalBacklash(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  AddHeld(
      scene, effect, unit,
      [&](const Row& row, std::size_t) {
        const double warm_K = row.temp_C - campaign.temp_mean_C;
        return DirectionOf(row, effect.axis) * effect.Amount(unit) * warm_K * (1 - 0.01 * warm_K);
      },
      track);
}

// Arms of two alloys, which follow their boards at once.
void ThermalArmGrowth(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double warm_K = campaign.At(m, unit).temp_C - campaign.temp_mean_C;
    track->growth[kTheta][m] += effect.Amount(unit) * warm_K;
    track->growth[kPhi][m] += 0.85 * effect.Amount(unit) * warm_K;
  }
}

// Heat leaves at once in part, and by radiation and grease slowly: half each.
void SelfHeating(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double slow_s = 150 + 450 * effect.shape[0];
  double fast = 0, slow = 0;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double since_s = m == 0 ? 0 : campaign.exposures[m].t_s - campaign.exposures[m - 1].t_s;
    const double heat = std::abs(TravelOf(campaign.At(m, unit), effect.axis)) / 100;
    fast = fast * std::exp(-4 * since_s / slow_s) + heat / 2;
    slow = slow * std::exp(-since_s / slow_s) + heat / 2;
    track->angle_deg[effect.axis][m] += effect.Amount(unit) * (fast + slow);
  }
}

// A plate that is held at its rim grows less there.
void PlateExpansion(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Place z = track->place_mm[m];
    const double out = std::norm(z / campaign.plate_radius_mm);
    track->place_mm[m] += effect.Amount(unit) *
                          (campaign.exposures[m].air_C - campaign.temp_mean_C) * z *
                          (1 - 0.1 * out);
  }
}

// ---- The camera.

void CameraDistortion(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const double rim_mm = effect.kind->typical * effect.size;
  const double astigmatic = 0.2 * effect.shape[0];
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    const Place z = track->place_mm[m] / scene.campaign->plate_radius_mm;
    const double r2 = std::norm(z);
    track->place_mm[m] += rim_mm * r2 * (z * (0.8 + 0.2 * r2) + astigmatic * std::conj(z));
  }
}

// The bias of a centroid is a sine of the place within a pixel.
void CentroidBias(const Scene& scene, const Effect& effect, std::size_t, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double bias_px = 0.02 * effect.kind->typical * effect.size;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Place px = (track->place_mm[m] - campaign.pixel_origin_mm) / campaign.pixel_mm;
    track->place_mm[m] -= bias_px * campaign.pixel_mm *
                          Place(std::sin(2 * kPi * px.real()), std::sin(2 * kPi * px.imag()));
  }
}

constexpr std::pair<std::string_view, ApplyEffect> kCurves[] = {
    {"ramp_travel", RampTravel},
    {"command_quantisation", Quantisation},
    {"step_loss", StepLoss},
    {"load_angle_lag", LoadAngleLag},
    {"supply_drift", SupplyDrift},
    {"supply_droop", SupplyDroop},
    {"cogging", Cogging},
    {"phase_imbalance", PhaseImbalance},
    {"mode_threshold", ModeThreshold},
    {"eccentricity", Eccentricity},
    {"pinion_runout", PinionRunout},
    {"stage_ripple", StageRipple},
    {"tooth_mesh", ToothMesh},
    {"tooth_damage", ToothDamage},
    {"hard_stop", HardStop},
    {"relaxation", Relaxation},
    {"gravity_torque", GravityTorque},
    {"axis_crosstalk", AxisCrosstalk},
    {"wear", Wear},
    {"thermal_backlash", ThermalBacklash},
    {"thermal_arm_growth", ThermalArmGrowth},
    {"self_heating", SelfHeating},
    {"plate_expansion", PlateExpansion},
    {"camera_distortion", CameraDistortion},
    {"centroid_bias", CentroidBias}};

}  // namespace

ApplyEffect CurveOf(std::string_view cause) {
  const auto* own =
      std::ranges::find(kCurves, cause, &std::pair<std::string_view, ApplyEffect>::first);
  return own != std::end(kCurves) ? own->second : HistoryCurveOf(cause);
}

}  // namespace focalfleet::hidden
