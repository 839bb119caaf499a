// Scale asymmetry: one turning direction travels farther than the other.
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListScaleAsymmetry(const CampaignFacts&, Templates* out) {
  ListGrid({.memories = {Memory::kChain, Memory::kNow}}, out);
}

void ApplyScaleAsymmetry(const UnitTrack& track, const Template& form,
                         std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  AddRemembered(
      track, axis, form.memory, [&](std::size_t i) { return amplitude[0] * std::abs(step[i]); },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeScaleAsymmetry() {
  return {.cause = "scale_asymmetry",
          .amplitude_unit = "deg/deg",
          .prior_size = 1e-3,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The axis turns farther one way than the other for the same command, so that it "
              "creeps with every back and forth. Friction or a load with a preferred "
              "direction does this; so does a supply that is weaker one way.",
          .list = ListScaleAsymmetry,
          .apply = ApplyScaleAsymmetry,
          .of_poses_alone = EachForm,
          .distortions = kOfMoves};
}

}  // namespace focalfleet::sim
