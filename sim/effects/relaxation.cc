// Relaxation: the arm creeps after the move.
#include <algorithm>
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {0.3, 1, 3, 10, 30, 100}, .shape_name = "time constant, s,"}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> delay = track.Column("delay_s");
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        return -amplitude[0] * Direction(step[i]) *
               (1 - std::exp(-std::max(delay[i], 0.0) / form.shape));
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeRelaxation() {
  return {.cause = "relaxation",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {"delay_s"},
          .paragraph =
              "After the motor has stopped the arm creeps back for seconds, against the "
              "direction of the move. Wait longer before the exposure, or expose always at "
              "the same delay.",
          .list = List,
          .apply = Apply,
          .continuous_shape = true};
}

}  // namespace focalfleet::sim
