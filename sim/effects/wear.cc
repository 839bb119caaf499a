// Wear: a parameter drifts with the turns made.
#include <string_view>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({}, out);
  ListGrid({.shape_name = "the clearance opens", .form = 1}, out);
  ListGrid({.shape_name = "the scale drifts", .form = 2}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::string_view column = axis == kTheta ? "cycles_theta" : "cycles_phi";
  const std::span<const double> cycles = track.Column(column);
  constexpr double kTurns = 100;
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    // Since the campaign began: what was worn before it is backlash or scale already.
    const double worn = (cycles[i] - cycles[0]) / kTurns;
    if (track.restarts[i]) direction = 0;
    if (track.step_deg[axis][i] != 0) direction = Direction(track.step_deg[axis][i]);
    double error = worn;
    if (form.form == 1) error = -worn * direction;
    if (form.form == 2) error = worn * track.cmd_deg[axis][i] / 90;
    errors->angle_deg[axis][i] += amplitude[0] * error;
  }
}

}  // namespace

Effect MakeWear() {
  return {.cause = "wear",
          .amplitude_unit = "deg per 100 turns",
          .prior_size = 1,
          .owner = Owner::kUnit,
          .needs = {"cycles_theta", "cycles_phi"},
          .paragraph =
              "The unit changes with the turns it has made, slowly and without return: its "
              "zero creeps, its clearance opens, or its scale drifts. Re-calibrate by turns, "
              "not by the calendar.",
          .list = List,
          .apply = Apply,
          .amplitude_low = -20,  // a gear that falls apart
          .amplitude_high = 20};
}

}  // namespace focalfleet::sim
