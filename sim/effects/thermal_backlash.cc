// Thermal backlash: clearance and viscosity change with temperature.
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  const FilledColumn* temperature = facts.Find("temp_C");
  ListGrid({.shapes = {20, temperature->mean, temperature->first}, .shape_name = "from, C,"}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> temperature = track.Column("temp_C");
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        return -amplitude[0] / 2 * Direction(step[i]) * (temperature[i] - form.shape);
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeThermalBacklash() {
  return {.cause = "thermal_backlash",
          .amplitude_unit = "deg/K",
          .prior_size = 0.005,
          .owner = Owner::kUnit,
          .needs = {"temp_C"},
          .paragraph =
              "The clearance of the gears or the viscosity of their grease depends on "
              "temperature, so that the error after a reversal does. Approach from one side, "
              "or compensate by the measured temperature.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
