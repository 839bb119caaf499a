// Effects that move an arm beside its drive are springs that creep, gravity, a crossing cable and
// wear. Others are a late start, a touched neighbour, and an axis that leans.
#include <algorithm>
#include <cmath>

#include "protocol/base/rng.h"
#include "tests/hidden/generator/effect.h"

namespace focalfleet::hidden {

namespace {

// Two Kelvin-Voigt elements in series, wound by the direction of the last move.
void Relaxation(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const auto direction = Directions(campaign, unit, effect.axis);
  const double creep_deg = effect.Amount(unit);
  const double tau_s = 2 + 18 * effect.shape[0];
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double t_s = campaign.At(m, unit).delay_s;
    const double gone =
        0.8 * (1 - std::exp(-t_s / tau_s)) + 0.2 * (1 - std::exp(-t_s / (3.5 * tau_s)));
    track->angle_deg[effect.axis][m] -= direction[m] * creep_deg * gone;
  }
}

// The arm's weight presses it to one side of its clearance; friction rounds the change of sides.
void GravityTorque(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const Geometry& geometry = campaign.units[unit].believed;
  const double half_deg = effect.Amount(unit) / 2;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    const double first = (row.cmd_deg[kTheta] + geometry.zero_deg[kTheta]) * kDegree;
    const double second = first + (row.cmd_deg[kPhi] + geometry.zero_deg[kPhi]) * kDegree;
    const double own = -std::cos(second);
    const double carried = -(1.5 * geometry.arm_mm[kTheta] * std::cos(first) +
                             0.5 * geometry.arm_mm[kPhi] * std::cos(second)) /
                           (1.5 * geometry.arm_mm[kTheta] + 0.5 * geometry.arm_mm[kPhi]);
    const double torque = effect.axis == kPhi ? own : carried;
    const double in_plane = std::cos(campaign.exposures[m].elevation_deg * kDegree);
    track->angle_deg[effect.axis][m] += half_deg * in_plane * std::tanh(5 * torque);
  }
}

// The fibre bundle of phi runs through theta's axis. The bundle twists theta as phi turns, or drags
// it in the direction in which phi last went.
void AxisCrosstalk(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const bool drags = effect.shape[0] > 0.6;
  const double amount = effect.Amount(unit);
  const auto direction = Directions(campaign, unit, kPhi);
  const double range_deg = campaign.units[unit].max_deg[kPhi] - campaign.units[unit].min_deg[kPhi];
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double phi_deg = track->angle_deg[kPhi][m];
    const double twist = phi_deg / range_deg - 0.5;
    track->angle_deg[kTheta][m] +=
        drags ? 20 * amount * direction[m]
              : amount * range_deg * std::sinh(0.5 * twist) / std::sinh(0.5);
  }
}

// Archard's law with running-in: wear grows a little slower than the travel.
void Wear(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double per_turn_deg = effect.Amount(unit);
  const double exponent = 0.8 + 0.2 * effect.shape[0];
  const Row& first = campaign.At(0, unit);
  const double before = first.cycles[effect.axis] -
                        std::abs(first.cmd_deg[effect.axis] - first.from_deg[effect.axis]) / 360;
  const double scale = std::max(30.0, before);
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const double turns = campaign.At(m, unit).cycles[effect.axis] - before;
    track->angle_deg[effect.axis][m] +=
        per_turn_deg * scale * (std::pow(1 + turns / scale, exponent) - 1) / exponent;
  }
}

// Units are started one after another as their frames arrive. A late unit is still braking when the
// picture is taken.
void StartSkew(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double per_slot_s = std::abs(effect.Amount(unit));
  const double speed_deg_s = 30;
  const double brake_s = 0.02;
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const Row& row = campaign.At(m, unit);
    // The camera waits the usual settling time; longer delays see the end of every move.
    if (row.delay_s > 2) continue;
    const double late_s = per_slot_s * (row.bus_slot + 1);
    for (std::size_t a = 0; a < kAxes; ++a) {
      const double travel = row.cmd_deg[a] - row.from_deg[a];
      if (travel == 0) continue;
      const double missing = late_s < brake_s ? 0.5 * speed_deg_s * late_s * late_s / brake_s
                                              : speed_deg_s * (late_s - brake_s / 2);
      track->angle_deg[a][m] -= std::copysign(std::min(missing, std::abs(travel)), travel);
    }
  }
}

// The axis leans: the circle of the arm is seen as an ellipse.
void AxisTilt(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const double lean_rad = std::clamp(effect.Amount(unit) * kDegree, -0.5, 0.5);
  const Place lean = std::polar(lean_rad, effect.phase_rad[unit]);
  for (std::size_t m = 0; m < scene.campaign->move_count(); ++m) {
    track->tilt_rad[0][m] += lean.real();
    track->tilt_rad[1][m] += lean.imag();
  }
}

// ---- Contact of two arms.

struct Segment {
  Place from;
  Place to;
};

Segment ArmOf(const Unit& unit, const ByAxis& angle_deg) {
  const Geometry& g = unit.believed;
  const Place elbow =
      g.base_mm + std::polar(g.arm_mm[kTheta], (angle_deg[kTheta] + g.zero_deg[kTheta]) * kDegree);
  return {elbow, FibreAt(g, angle_deg)};
}

double DistanceToPoint(const Segment& s, const Place& p) {
  const Place along = s.to - s.from;
  const double t =
      std::clamp((std::conj(along) * (p - s.from)).real() / std::norm(along), 0.0, 1.0);
  return std::abs(p - s.from - t * along);
}

double Distance(const Segment& a, const Segment& b) {
  const auto side = [](const Segment& s, const Place& p) {
    return (std::conj(s.to - s.from) * (p - s.from)).imag();
  };
  if (side(a, b.from) * side(a, b.to) < 0 && side(b, a.from) * side(b, a.to) < 0) return 0;
  return std::min({DistanceToPoint(a, b.from), DistanceToPoint(a, b.to), DistanceToPoint(b, a.from),
                   DistanceToPoint(b, a.to)});
}

// Two arms that would overlap push each other aside, each by half, as far as they are stiff.
void CollisionContact(const Scene& scene, const Effect& effect, std::size_t unit, Track* track) {
  const Campaign& campaign = *scene.campaign;
  const double stiffness = std::min(1.0, std::abs(effect.Amount(unit)));
  const double thick_mm = 2 * 0.08 * campaign.pitch_mm;
  const Unit& self = campaign.units[unit];
  for (std::size_t m = 0; m < campaign.move_count(); ++m) {
    const ByAxis angle = campaign.At(m, unit).cmd_deg;
    for (const std::size_t o : scene.neighbours[unit]) {
      const Segment other = ArmOf(campaign.units[o], campaign.At(m, o).cmd_deg);
      const double gap_mm = Distance(ArmOf(self, angle), other);
      if (gap_mm >= thick_mm) continue;
      // Phi yields to the side on which the gap grows.
      constexpr double kProbe_deg = 2;
      const double more = Distance(ArmOf(self, {angle[kTheta], angle[kPhi] + kProbe_deg}), other);
      const double less = Distance(ArmOf(self, {angle[kTheta], angle[kPhi] - kProbe_deg}), other);
      const double push_mm = 0.5 * stiffness * (thick_mm - gap_mm);
      const double push_deg = push_mm / self.believed.arm_mm[kPhi] / kDegree;
      track->angle_deg[kPhi][m] += more >= less ? push_deg : -push_deg;
    }
  }
}

}  // namespace

std::vector<double> Directions(const Campaign& campaign, std::size_t unit, std::size_t axis) {
  std::vector<double> out(campaign.move_count());
  double direction = 0;
  for (std::size_t m = 0; m < out.size(); ++m) {
    const Row& row = campaign.At(m, unit);
    if (row.rehomed) direction = axis == kTheta ? -1 : 1;
    if (row.Moved(axis)) direction = row.cmd_deg[axis] > row.from_deg[axis] ? 1 : -1;
    out[m] = direction;
  }
  return out;
}

std::vector<EffectKind> ArmEffects() {
  const std::vector<Owner> mechanical = {Owner::kUnit, Owner::kPlate};
  return {
      {"relaxation",
       Stage::kExposure,
       AxisUse::kEither,
       0.03,
       "deg",
       40,
       false,
       mechanical,
       {"delay_s"},
       1,
       false,
       Relaxation},
      {"gravity_torque",
       Stage::kExposure,
       AxisUse::kEither,
       0.06,
       "deg",
       40,
       false,
       mechanical,
       {"elevation_deg"},
       1,
       false,
       GravityTorque},
      {"axis_crosstalk",
       Stage::kExposure,
       AxisUse::kThetaOnly,
       5e-4,
       "1",
       60,
       true,
       mechanical,
       {},
       1,
       false,
       AxisCrosstalk},
      {"wear",
       Stage::kExposure,
       AxisUse::kEither,
       2e-3,
       "deg per turn",
       60,
       true,
       mechanical,
       {"cycles_theta", "cycles_phi"},
       1,
       false,
       Wear},
      {"start_skew",
       Stage::kExposure,
       AxisUse::kNone,
       5e-4,
       "s per slot",
       60,
       false,
       {Owner::kBus, Owner::kPlate},
       {"bus_id", "bus_slot"},
       1,
       false,
       StartSkew},
      {"axis_tilt",
       Stage::kExposure,
       AxisUse::kNone,
       2,
       "deg",
       10,
       false,
       mechanical,
       {},
       2,
       false,
       AxisTilt},
      {"collision_contact",
       Stage::kExposure,
       AxisUse::kNone,
       0.01,
       "share of the overlap",
       90,
       false,
       {Owner::kUnit, Owner::kPlate},
       {},
       1,
       true,
       CollisionContact},
  };
}

}  // namespace focalfleet::hidden
