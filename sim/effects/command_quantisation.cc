// Command quantisation: commands are rounded.
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  for (const int form : {0, 1})
    ListGrid(
        {.shapes = {0.01, 0.02, 0.025, 0.04, 0.05, 0.08, 0.1, 0.2, 0.25, 0.4, 0.5, 0.8, 1, 1.6, 2},
         .shape_name = form == 0 ? "step, deg," : "moves are cut; step, deg,",
         .form = form},
        out);
  ListGrid({.shapes = {1, 4, 24, 96}, .shape_name = "steps a motor turn:", .form = 2}, out);
  for (const int form : {3, 4})
    ListGrid({.shapes = {9, 10, 11, 12, 13, 14},
              .shape_name = form == 3 ? "bits a turn:" : "moves are cut; bits a turn:",
              .form = form},
             out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  double step_deg = form.shape;
  if (form.form == 2) step_deg = 360 / (form.shape * track.unit->gear[axis]);
  if (form.form >= 3) step_deg = 360 / std::exp2(form.shape);
  const bool cut = form.form == 1 || form.form == 4;
  double behind_deg = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    if (track.restarts[i]) behind_deg = 0;
    const double q = track.cmd_deg[axis][i];
    const double move = track.step_deg[axis][i];
    behind_deg += std::trunc(move / step_deg) * step_deg - move;
    const double error = cut ? behind_deg : std::round(q / step_deg) * step_deg - q;
    errors->angle_deg[axis][i] += amplitude[0] * error;
  }
}

}  // namespace

Effect MakeCommandQuantisation() {
  return {.cause = "command_quantisation",
          .amplitude_unit = "steps",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The command is rounded (or cut) to a step of the controller, so that the error "
              "is a saw-tooth of the command. It adds up if each move is rounded by itself.",
          .list = List,
          .apply = Apply,
          .amplitude_low = 0,
          .amplitude_high = 1.5,
          .amplitude_least = 0.5};
}

}  // namespace focalfleet::sim
