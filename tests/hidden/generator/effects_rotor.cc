// Effects on the rest of a rotor in the field of its drive. Its angle is that of the output times
// the gear. A shift by tens of electrical degrees is a few hundredths of a degree at the arm.
#include <algorithm>
#include <cmath>
#include <map>

#include "tests/hidden/generator/along_track.h"

namespace focalfleet::hidden {

namespace {

double LagAt(double load, double drive) { return std::asin(std::min(0.985, load / drive)); }

void LoadAngleLag(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const auto direction = Directions(*scene.campaign, unit, effect.axis);
  const double load = std::abs(effect.Amount(unit));
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double) {
        return -direction[m] * LagAt(load, DriveOf(*scene.campaign, m, unit));
      },
      track);
}

// The firmware corrects for the lag at the voltage of the day; the effect is the part that the slow
// fall of the supply adds.
void SupplyDrift(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const auto direction = Directions(campaign, unit, effect.axis);
  const double load = std::abs(effect.Amount(unit));
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double) {
        const double drive = DriveOf(campaign, m, unit);
        const double usual = drive * campaign.v_mean_V / campaign.At(m, unit).v_bus_V;
        return -direction[m] * (LagAt(load, drive) - LagAt(load, usual));
      },
      track);
}

// Kirchhoff's laws along one harness: each segment carries the current of all movers behind it, in
// addition to the drop of the feed itself. Returns the share of the voltage that is missing at
// `unit`.
double MissingShare(const Campaign& campaign, std::size_t move, std::size_t unit,
                    double drop_per_mover, double feed) {
  const Unit& self = campaign.units[unit];
  double missing = 0;
  for (std::size_t o = 0; o < campaign.unit_count(); ++o) {
    const Unit& other = campaign.units[o];
    const Row& row = campaign.At(move, o);
    if (other.rail != self.rail || !(row.Moved(kTheta) || row.Moved(kPhi))) continue;
    const double axes = (row.Moved(kTheta) ? 0.5 : 0) + (row.Moved(kPhi) ? 0.5 : 0);
    const int shared = 1 + std::min(other.rail_slot, self.rail_slot);  // segments in common
    missing += drop_per_mover * axes * (feed + shared);
  }
  return missing;
}

void SupplyDroop(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double drop = std::abs(effect.Amount(unit));
  if (drop <= 0) return;
  const double feed = 2 + 10 * effect.shape[0];
  constexpr double kLoad = 0.4;  // of the torque at the tuned drive
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    const auto direction = Directions(campaign, unit, axis);
    Effect along = effect;
    along.axis = axis;
    AddAtRest(
        scene, along, unit,
        [&](std::size_t m, double) {
          const double drive = DriveOf(campaign, m, unit);
          const double left = std::max(0.3, 1 - MissingShare(campaign, m, unit, drop, feed));
          return -direction[m] * (LagAt(kLoad, drive * left) - LagAt(kLoad, drive));
        },
        track);
  }
}

// The rotor settles where field torque and detent torque cancel, by Newton's method.
void Cogging(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double detent = effect.Amount(unit);
  const double order = effect.shape[0] < 0.2 ? 1 : effect.shape[0] < 0.6 ? 2 : 6;
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double rotor_rad) {
        const double drive = DriveOf(*scene.campaign, m, unit);
        double behind = 0;
        for (int i = 0; i < 12; ++i) {
          const double wave = order * (rotor_rad - behind) + effect.phase_rad[unit];
          const double torque = drive * std::sin(behind) - detent * std::sin(wave);
          const double slope = drive * std::cos(behind) + order * detent * std::cos(wave);
          behind -= std::clamp(torque / std::max(0.2, slope), -0.3, 0.3);
        }
        return -behind;
      },
      track);
}

// Phases of unequal gain, offset currents, or the dead time of a bridge turn the field slightly
// from its commanded direction.
void PhaseImbalance(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double amount = effect.Amount(unit);
  const double kind = effect.shape[0];  // gain, offset, dead time
  const double turn = effect.phase_rad[unit];
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double rotor_rad) {
        const double drive = DriveOf(*scene.campaign, m, unit);
        Place field = std::polar(drive, rotor_rad);
        if (kind < 0.5) {
          field += amount * std::polar(drive, turn - rotor_rad);  // an ellipse
        } else if (kind < 0.8) {
          field += std::polar(amount, turn);
        } else {
          for (int phase = 0; phase < 3; ++phase) {
            const double at = rotor_rad - 2 * kPi / 3 * phase;
            field -= amount * std::tanh(12 * std::cos(at)) * std::polar(1.0, 2 * kPi / 3 * phase);
          }
        }
        return std::remainder(std::arg(field) - rotor_rad, 2 * kPi);
      },
      track);
}

// Short moves run in another mode than long ones and come to rest a little short.
void ModeThreshold(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double short_deg = effect.Amount(unit);
  const double limit_deg = 2 + 18 * effect.shape[0];
  const double gear = campaign.units[unit].gear[effect.axis];
  const auto direction = Directions(campaign, unit, effect.axis);
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double) {
        const Row& row = campaign.At(m, unit);
        const double travel = std::abs(row.cmd_deg[effect.axis] - row.from_deg[effect.axis]);
        return travel < limit_deg ? -direction[m] * short_deg * kDegree * gear : 0.0;
      },
      track);
}

// Rotors of neighbours are magnets of finite length and turn each other. At rest both are where
// their commands left them.
void NeighbourCoupling(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double strength = effect.Amount(unit);
  const double half_mm = 1.5;  // of a rotor's magnet
  const auto psi = [&](std::size_t m, std::size_t u) {
    const double turns =
        campaign.At(m, u).cmd_deg[effect.axis] * campaign.units[u].gear[effect.axis];
    return std::remainder(turns, 360.0) * kDegree;
  };
  AddAtRest(
      scene, effect, unit,
      [&](std::size_t m, double rotor_rad) {
        double torque = 0;
        for (const std::size_t o : scene.neighbours[unit]) {
          const double d =
              std::abs(campaign.units[o].believed.base_mm - campaign.units[unit].believed.base_mm) /
              campaign.pitch_mm;
          const double half = half_mm / campaign.pitch_mm;
          const double finite = std::pow(d * d + half * half, -1.5);
          torque += finite * std::sin(rotor_rad - psi(m, o));
        }
        return std::asin(std::clamp(strength * torque / DriveOf(campaign, m, unit), -0.98, 0.98));
      },
      track);
}

}  // namespace

std::vector<EffectKind> RotorEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"load_angle_lag",
       Stage::kRest,
       AxisUse::kEither,
       0.3,
       "share of the pull-out torque",
       3,
       false,
       mechanical,
       {"drive_amplitude"},
       1,
       false,
       LoadAngleLag},
      {"supply_drift",
       Stage::kRest,
       AxisUse::kEither,
       0.4,
       "share of the pull-out torque",
       2.3,
       false,
       {Owner::kPlate},
       {"v_bus_V"},
       1,
       false,
       SupplyDrift},
      {"supply_droop",
       Stage::kRest,
       AxisUse::kNone,
       5e-4,
       "share per mover and segment",
       60,
       false,
       {Owner::kRail, Owner::kPlate},
       {"rail_id", "rail_slot", "movers_on_rail"},
       1,
       false,
       SupplyDroop},
      {"cogging",
       Stage::kRest,
       AxisUse::kEither,
       0.15,
       "share of the pull-out torque",
       4,
       false,
       mechanical,
       {},
       2,
       false,
       Cogging},
      {"phase_imbalance",
       Stage::kRest,
       AxisUse::kEither,
       0.08,
       "share of the amplitude",
       6,
       false,
       mechanical,
       {},
       2,
       false,
       PhaseImbalance},
      {"mode_threshold",
       Stage::kRest,
       AxisUse::kEither,
       0.02,
       "deg",
       40,
       true,
       mechanical,
       {},
       1,
       false,
       ModeThreshold},
      {"neighbour_coupling",
       Stage::kRest,
       AxisUse::kEither,
       0.05,
       "share of the pull-out torque",
       8,
       false,
       {Owner::kPlate},
       {},
       1,
       false,
       NeighbourCoupling},
  };
}

}  // namespace focalfleet::hidden
