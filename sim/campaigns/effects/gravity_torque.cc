// Gravity torque: the arm's weight takes up the clearance.
#include <cmath>
#include <numbers>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Positions of the arm's masses are not in units.csv. Form 0 has them in the fibre. Form 1 has them
// mostly in phi's motor at the elbow, whose lever turns with theta alone.
constexpr double kElbowShare = 0.75;

void ListGravityTorque(const CampaignFacts&, Templates* out) {
  // Shapes range from a spring, which yields in proportion to the torque, to play, which depends on
  // its sign alone.
  for (const int form : {0, 1})
    ListGrid({.shapes = {0.3, 2, 5, 30},
              .shape_name = form == 0 ? "saturates from a torque of 1 over"
                                      : "mass at the elbow; saturates from a torque of 1 over",
              .form = form},
             out);
}

void ApplyGravityTorque(const UnitTrack& track, const Template& form,
                        std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> elevation = track.Column("elevation_deg");
  const double elbow = form.form == 1 && axis == kTheta ? kElbowShare : 0.5;
  const double full_mm =
      axis == kPhi ? track.unit->arm_mm[kPhi]
                   : elbow * track.unit->arm_mm[kTheta] + (1 - elbow) * track.unit->arm_mm[kPhi];
  for (std::size_t i = 0; i < track.moves; ++i) {
    // Gravity points to -y in the plate's frame, so that the torque goes with the lever along x.
    const double lever_mm = axis == kPhi
                                ? track.reach_x_mm[i]
                                : elbow * track.elbow_x_mm[i] + (1 - elbow) * track.reach_x_mm[i];
    const double side = std::tanh(form.shape * lever_mm / full_mm) / std::tanh(form.shape);
    errors->angle_deg[axis][i] -=
        amplitude[0] / 2 * std::cos(elevation[i] * std::numbers::pi / 180) * side;
  }
}

}  // namespace

Effect MakeGravityTorque() {
  return {.cause = "gravity_torque",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {"elevation_deg"},
          .paragraph =
              "The weight of the arm presses the gears to one side of their clearance. The "
              "side changes where the arm crosses the vertical, and the effect vanishes at "
              "the zenith.",
          .list = ListGravityTorque,
          .apply = ApplyGravityTorque,
          .continuous_shape = true,
          // At one elevation the side of the gears goes with the angle alone.
          .passes_for = {"eccentricity"}};
}

}  // namespace focalfleet::sim
