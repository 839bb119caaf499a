// Gravity torque: the arm's weight takes up the clearance.
#include <cmath>
#include <numbers>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({}, out);
  ListGrid({.form = 1}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> elevation = track.Column("elevation_deg");
  const double full_mm = track.unit->arm_mm[kTheta] + track.unit->arm_mm[kPhi];
  for (std::size_t i = 0; i < track.moves; ++i) {
    // Gravity points to -y in the plate's frame, so that the torque goes with the lever along x.
    const double lever_mm =
        axis == kTheta ? track.elbow_x_mm[i] + track.reach_x_mm[i] : track.reach_x_mm[i];
    const double side = form.form == 1 ? lever_mm / full_mm : (lever_mm > 0 ? 1.0 : -1.0);
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
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
