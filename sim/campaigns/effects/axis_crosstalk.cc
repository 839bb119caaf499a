// Axis cross-talk: one axis turns when the other moves.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListAxisCrosstalk(const CampaignFacts&, Templates* out) {
  ListGrid({.memories = {Memory::kChain, Memory::kNow}}, out);
  ListGrid({.memories = {Memory::kHold, Memory::kNow}, .form = 1}, out);
}

void ApplyAxisCrosstalk(const UnitTrack& track, const Template& form,
                        std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::size_t other = axis == kTheta ? kPhi : kTheta;
  const std::span<const double> step = track.step_deg[other];
  // Form 0 is in proportion to the other axis' move, form 1 goes by its direction alone.
  constexpr double kUsualStep_deg = 30;
  AddRemembered(
      track, other, form.memory,
      [&](std::size_t i) {
        return amplitude[0] * (form.form == 0 ? step[i] : kUsualStep_deg * Direction(step[i]));
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeAxisCrosstalk() {
  return {.cause = "axis_crosstalk",
          .amplitude_unit = "deg/deg",
          .prior_size = 1e-3,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Moving one axis turns the other a little: the fibre bundle's torque, a shared "
              "shaft, or a bearing's drag. Move the axes one after the other to see it.",
          .list = ListAxisCrosstalk,
          .apply = ApplyAxisCrosstalk,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
