// Wear: a parameter drifts with the turns made.
#include <algorithm>
#include <string_view>
#include <vector>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  for (const int form : {0, 1, 2})
    ListGrid({.shapes = form == 0 ? std::vector<double>{0} : std::vector<double>{0, 1},
              .shape_name = form == 0   ? "the zero creeps"
                            : form == 1 ? "the clearance opens"
                                        : "the scale drifts",
              .form = form},
             out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::string_view column = axis == kTheta ? "cycles_theta" : "cycles_phi";
  const std::span<const double> cycles = track.Column(column);
  const FilledColumn& all = *track.facts->Find(column);
  double direction = 0;
  for (std::size_t i = 0; i < track.moves; ++i) {
    // Since the campaign began, in parts of what it wore; or since the unit was new.
    const double since = form.shape == 0 ? cycles[i] - cycles[0] : cycles[i];
    const double worn = since / std::max(all.high - (form.shape == 0 ? all.low : 0), 1e-9);
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
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {"cycles_theta", "cycles_phi"},
          .paragraph =
              "The unit changes with the turns it has made, slowly and without return: its "
              "zero creeps, its clearance opens, or its scale drifts. Re-calibrate by turns, "
              "not by the calendar.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
