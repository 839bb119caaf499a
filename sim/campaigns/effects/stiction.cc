// Stiction: small moves are lost.
#include <cmath>
#include <iterator>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr double kStays = 0.15;  // share of the wind-up at which the arm breaks loose

void ListStiction(const CampaignFacts&, Templates* out) {
  constexpr double kThresholds_deg[] = {0.05, 0.07, 0.1,  0.14, 0.2, 0.28, 0.4,
                                        0.57, 0.8,  1.13, 1.6,  2.3, 3.2};
  ListGrid({.memories = {Memory::kNow, Memory::kHold, Memory::kChain},
            .shapes = {std::begin(kThresholds_deg), std::end(kThresholds_deg)},
            .shape_name = "below, deg,"},
           out);
  // The arm stays until the command is a threshold away from it, then it jumps to the command.
  ListGrid({.shapes = {std::begin(kThresholds_deg), std::end(kThresholds_deg)},
            .shape_name = "jumps from, deg,",
            .form = 1},
           out);
  // The arm jumps in the same way and stops short of the command: some wind-up stays.
  ListGrid({.shapes = {std::begin(kThresholds_deg), std::end(kThresholds_deg)},
            .shape_name = "jumps, but not home, from, deg,",
            .form = 2},
           out);
}

void ApplyStiction(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                   PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  double behind_deg = 0;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        if (form.form == 0) return std::abs(step[i]) < form.shape ? -amplitude[0] * step[i] : 0.0;
        if (track.restarts[i]) behind_deg = 0;
        behind_deg += step[i];
        if (std::abs(behind_deg) >= form.shape)
          behind_deg = form.form == 2 ? kStays * std::copysign(form.shape, behind_deg) : 0;
        return -amplitude[0] * behind_deg;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeStiction() {
  return {.cause = "stiction",
          .amplitude_unit = "share of the move",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Moves shorter than a threshold are swallowed by static friction: the arm stays "
              "where it was. Avoid short corrections, or overshoot and come back.",
          .list = ListStiction,
          .apply = ApplyStiction,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          .amplitude_low = 0,
          .amplitude_high = 1.2,
          .amplitude_least = 0.3,
          .distortions = kOfMoves};
}

}  // namespace focalfleet::sim
