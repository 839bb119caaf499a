// Self-heating: the motor warms itself by moving.
#include <algorithm>
#include <cmath>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr double kWinding_s = 15;  // the winding's own time constant

void ListSelfHeating(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {60, 180, 600, 1800}, .shape_name = "time constant, s,"}, out);
  // Two masses: the housing, and the winding that heats it.
  ListGrid({.shapes = {60, 180, 600, 1800},
            .shape_name = "housing and winding; time constant, s,",
            .form = 3,
            .columns = 2},
           out);
  ListGrid({.shapes = {60, 180, 600, 1800},
            .shape_name = "against the direction; time constant, s,",
            .form = 1},
           out);
  // Growth of the warm unit's arms.
  ListGrid({.axes = {EffectAxis::kBoth},
            .shapes = {60, 180, 600, 1800},
            .shape_name = "arms; time constant, s,",
            .form = 2},
           out);
}

void ApplySelfHeating(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> time = track.Column("t_s");
  const std::size_t axis = AxisIndex(form);
  std::span<const double> drive;
  if (track.facts->Has("drive_amplitude")) drive = track.Column("drive_amplitude");
  double housing = 0, winding = 0;  // warmth, in turns at full drive
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double elapsed_s = i == 0 ? 0 : std::max(time[i] - time[i - 1], 0.0);
    if (form.form == 3) {
      // The winding's heat arrives in the housing while both cool.
      const double tau_s = std::max(form.shape, 2 * kWinding_s);
      const double fades = std::exp(-elapsed_s / kWinding_s), kept = std::exp(-elapsed_s / tau_s);
      housing = housing * kept + winding * (kept - fades) * tau_s / (tau_s - kWinding_s);
      winding *= fades;
    } else {
      housing *= std::exp(-elapsed_s / form.shape);
    }
    double heat_turns = 0;
    for (const std::size_t other : {kTheta, kPhi})
      if (form.form == 2 || other == axis) heat_turns += std::abs(track.step_deg[other][i]) / 360;
    // Copper losses go with the square of the current.
    if (!drive.empty()) heat_turns *= drive[i] * drive[i];
    (form.form == 3 ? winding : housing) += heat_turns;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    if (form.form == 0) errors->angle_deg[axis][i] += amplitude[0] * housing;
    if (form.form == 1) errors->angle_deg[axis][i] -= amplitude[0] * housing * direction;
    if (form.form == 3)
      errors->angle_deg[axis][i] += amplitude[0] * housing + amplitude[1] * winding;
    for (const std::size_t arm : {kTheta, kPhi})
      if (form.form == 2)
        errors->arm_mm[arm][i] += amplitude[0] * housing * track.unit->arm_mm[arm] * 0.01;
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
          .list = ListSelfHeating,
          .apply = ApplySelfHeating,
          .continuous_shape = true};
}

}  // namespace focalfleet::sim
