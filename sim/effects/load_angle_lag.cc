// Load angle lag: the rotor rests behind its field.
#include <algorithm>
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  ListGrid({}, out);
  if (facts.Has("v_bus_V")) ListGrid({.form = 1}, out);
  ListGrid(
      {.shapes = {0.5, 0.8}, .shape_name = "load, of the pull-out at nominal drive,", .form = 2},
      out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> drive = track.Column("drive_amplitude");
  std::span<const double> volts;
  if (form.form == 1) volts = track.Column("v_bus_V");
  const double usual_V = form.form == 1 ? track.facts->Find("v_bus_V")->mean : 1;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        double level = std::max(drive[i], 0.05);
        if (form.form == 1 && usual_V > 0) level *= std::max(volts[i] / usual_V, 0.05);
        const double lag =
            form.form == 2 ? std::asin(std::min(form.shape / level, 1.0)) / form.shape : 1 / level;
        return -amplitude[0] * Direction(step[i]) * lag;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeLoadAngleLag() {
  return {.cause = "load_angle_lag",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {"drive_amplitude"},
          .paragraph =
              "Under friction the rotor stops behind the field that holds it, the more the "
              "weaker the drive. It looks like backlash as long as the drive level never "
              "changes.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
