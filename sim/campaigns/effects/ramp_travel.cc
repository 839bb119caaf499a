// Ramp travel: a constant extra travel per move.
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListRampTravel(const CampaignFacts&, Templates* out) {
  ListGrid({.memories = {Memory::kChain}}, out);
  // Short moves never reach full speed.
  ListGrid({.memories = {Memory::kChain},
            .shapes = {0.3, 1, 3},
            .shape_name = "less in moves shorter than, deg,",
            .form = 1},
           out);
}

void ApplyRampTravel(const UnitTrack& track, const Template& form,
                     std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        const double ramp =
            form.form == 0 ? 1 : std::sqrt(std::min(1.0, std::abs(step[i]) / form.shape));
        return amplitude[0] * Direction(step[i]) * ramp;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeRampTravel() {
  return {.cause = "ramp_travel",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Each move ends a constant angle too far (or short), however long it was: "
              "motion in the ramps at its ends that the command does not count. As long as "
              "all moves have one length it looks like a scale error.",
          .list = ListRampTravel,
          .apply = ApplyRampTravel,
          .of_poses_alone = EachForm,
          .amplitude_low = -10,
          .amplitude_high = 10,
          .distortions = kOfMoves};
}

}  // namespace focalfleet::sim
