// Supply drift: the voltage falls over the campaign.
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  const FilledColumn* volts = facts.Find("v_bus_V");
  ListGrid({.shapes = {volts->high, volts->mean}, .shape_name = "below, V,"}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> volts = track.Column("v_bus_V");
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) { return -amplitude[0] * Direction(step[i]) * (form.shape - volts[i]); },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeSupplyDrift() {
  return {.cause = "supply_drift",
          .amplitude_unit = "deg/V",
          .prior_size = 0.05,
          .owner = Owner::kPlate,
          .needs = {"v_bus_V"},
          .paragraph =
              "The supply (a battery, a warm regulator) sinks while the campaign runs, and "
              "the lag of all units grows with it. Log and regulate the voltage.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
