// Axis tilt: an axis is not parallel to the optical axis.
#include <cmath>
#include <numbers>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListAxisTilt(const CampaignFacts&, Templates* out) {
  ListGrid({.columns = 2}, out);
  ListGrid({.form = 1, .columns = 2}, out);
}

void ApplyAxisTilt(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                   PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  constexpr double kRadians = std::numbers::pi / 180;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (form.form == 1) {  // in terms of the shaft's angle
      const double twice = 2 * track.cmd_deg[axis][i] * kRadians;
      errors->angle_deg[axis][i] +=
          (amplitude[0] * std::sin(twice) + amplitude[1] * std::cos(twice)) / kRadians;
      continue;
    }
    // The tilted circle is an ellipse in the frame that carries the axis: the plate, or the theta
    // arm.
    double x = track.elbow_x_mm[i] + track.reach_x_mm[i];
    double y = track.elbow_y_mm[i] + track.reach_y_mm[i];
    double turned = 0;
    if (axis == kPhi) {
      x = track.reach_x_mm[i], y = track.reach_y_mm[i];
      turned = 2 * (track.cmd_deg[kTheta][i] + track.unit->zero_deg[kTheta]) * kRadians;
    }
    const double a = amplitude[0] * std::cos(turned) - amplitude[1] * std::sin(turned);
    const double b = amplitude[0] * std::sin(turned) + amplitude[1] * std::cos(turned);
    errors->x_mm[i] += a * x + b * y;
    errors->y_mm[i] += b * x - a * y;
  }
}

}  // namespace

Effect MakeAxisTilt() {
  return {.cause = "axis_tilt",
          .amplitude_unit = "mm/mm",
          .prior_size = 2e-4,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "An axis leans, so that the camera sees its circle as an ellipse: an error of "
              "two periods a turn, along one direction. The lean is the unit's own; a "
              "distortion of the camera looks alike on one unit, not on a plate full of them.",
          .list = ListAxisTilt,
          .apply = ApplyAxisTilt,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
