// Gear scale: the axis turns a little more or less than commanded, in proportion.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListGearScale(const CampaignFacts&, Templates* out) {
  ListGrid({.memories = {Memory::kChain, Memory::kNow}}, out);
}

void ApplyGearScale(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                    PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  AddRemembered(
      track, axis, form.memory, [&](std::size_t i) { return amplitude[0] * step[i]; },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeGearScale() {
  return {.cause = "gear_scale",
          .amplitude_unit = "deg/deg",
          .prior_size = 1e-3,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The axis turns a fixed share more or less than it is told: a wrong gear ratio, "
              "or an axis that loses motion in proportion to what it moves. Open loop the "
              "error grows with the distance from where the unit was homed. Calibrate the "
              "ratio, and look at the gear if one unit stands out.",
          .list = ListGearScale,
          .apply = ApplyGearScale,
          .of_poses_alone = EachForm,
          .amplitude_low = -1,  // an axis that stands still
          .amplitude_high = 0.5,
          .distortions = kOfCounts};
}

}  // namespace focalfleet::sim
