// Mode threshold: short moves run in another mode.
#include <cmath>
#include <vector>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListModeThreshold(const CampaignFacts&, Templates* out) {
  const std::vector<double> lengths_deg = {1, 2, 3, 5, 10, 20, 40};
  ListGrid({.memories = {Memory::kHold, Memory::kNow},
            .shapes = lengths_deg,
            .shape_name = "below, deg,"},
           out);
  // Memory kChain: the travel that a move lacks in the other mode adds up.
  ListGrid({.memories = {Memory::kHold, Memory::kNow, Memory::kChain},
            .shapes = lengths_deg,
            .shape_name = "along the motion; below, deg,",
            .form = 1},
           out);
}

// An error that adds up in nearly all moves belongs to another cause: most moves have to be longer
// than the threshold.
bool ShowsModeThreshold(const Template& form, const CampaignFacts& facts) {
  constexpr double kLonger = 0.7;  // of the axis' moves
  if (form.memory != Memory::kChain) return true;
  double moves = 0, longer = 0;
  for (const double step : facts.step_deg[AxisIndex(form)]) {
    moves += step != 0 ? 1 : 0;
    longer += std::abs(step) >= form.shape ? 1 : 0;
  }
  return longer >= kLonger * moves;
}

void ApplyModeThreshold(const UnitTrack& track, const Template& form,
                        std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        return std::abs(step[i]) < form.shape
                   ? amplitude[0] * (form.form == 0 ? 1.0 : Direction(step[i]))
                   : 0.0;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeModeThreshold() {
  return {.cause = "mode_threshold",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Moves below a length run in another mode of the firmware (creep instead of "
              "cruise), which ends a little elsewhere: the error steps at that length.",
          .list = ListModeThreshold,
          .apply = ApplyModeThreshold,
          .continuous_shape = true,
          .shows = ShowsModeThreshold};
}

}  // namespace focalfleet::sim
