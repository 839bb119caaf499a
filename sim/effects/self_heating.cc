// Self-heating: the motor warms itself by moving.
#include <algorithm>
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {60, 180, 600, 1800}, .shape_name = "time constant, s,"}, out);
  ListGrid({.shapes = {60, 180, 600, 1800},
            .shape_name = "against the direction; time constant, s,",
            .form = 1},
           out);
  // The warm unit's arms grow.
  ListGrid({.axes = {EffectAxis::kBoth},
            .shapes = {60, 180, 600, 1800},
            .shape_name = "arms; time constant, s,",
            .form = 2},
           out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::span<const double> time = track.Column("t_s");
  const std::size_t axis = AxisIndex(form);
  double warmth_turns = 0;
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double elapsed_s = i == 0 ? 0 : std::max(time[i] - time[i - 1], 0.0);
    warmth_turns *= std::exp(-elapsed_s / form.shape);
    for (const std::size_t other : {kTheta, kPhi})
      if (form.form == 2 || other == axis) warmth_turns += std::abs(track.step_deg[other][i]) / 360;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    if (form.form == 0) errors->angle_deg[axis][i] += amplitude[0] * warmth_turns;
    if (form.form == 1) errors->angle_deg[axis][i] -= amplitude[0] * warmth_turns * direction;
    for (const std::size_t arm : {kTheta, kPhi})
      if (form.form == 2)
        errors->arm_mm[arm][i] += amplitude[0] * warmth_turns * track.unit->arm_mm[arm] * 0.01;
  }
}

}  // namespace

Effect MakeSelfHeating() {
  return {.cause = "self_heating",
          .amplitude_unit = "deg per turn",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {"t_s"},
          .paragraph =
              "Recent motion warms the motor, and the error follows that warmth with a time "
              "constant of minutes. Pause, or spread the moves.",
          .list = List,
          .apply = Apply,
          .continuous_shape = true};
}

}  // namespace focalfleet::sim
