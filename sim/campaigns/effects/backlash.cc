// Backlash: lost motion between motor and arm.
#include <algorithm>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListBacklash(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {0, 0.1, 0.3, 1, 3}, .shape_name = "gap, deg,"}, out);
  ListGrid({.memories = {Memory::kNow}}, out);
}

void ApplyBacklash(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                   PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const double half_deg = form.shape / 2;
  // Play: the arm lags the motor by at most half the gap on either side. An unknown side before the
  // first move counts as the middle.
  double side = 0;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        if (track.restarts[i]) side = 0;
        side = half_deg > 0 ? std::clamp(side + step[i] / half_deg, -1.0, 1.0) : Direction(step[i]);
        return -amplitude[0] / 2 * side;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeBacklash() {
  return {.cause = "backlash",
          .amplitude_unit = "deg",
          .prior_size = 0.1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "After each reversal the motor turns through the clearance of the gears before "
              "the arm follows, so that the arm rests on one side of the gap or on the other. "
              "Approach always from one side, or command the gap in addition after a "
              "reversal.",
          .list = ListBacklash,
          .apply = ApplyBacklash,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          .amplitude_is_shape = true,
          .distortions = kOfMoves,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
