// Start skew: units late in the start order are still moving.
#include <algorithm>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts&, Templates* out) {
  ListGrid({.memories = {Memory::kHold, Memory::kNow},
            .shapes = {0, 0.25, 0.5, 0.75},
            .shape_name = "from this share of the slots:"},
           out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> slot = track.Column("bus_slot");
  const double last = std::max(track.facts->Find("bus_slot")->high, 1.0);
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        return -amplitude[0] * Direction(step[i]) * std::max(slot[i] / last - form.shape, 0.0);
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeStartSkew() {
  return {.cause = "start_skew",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kBus,
          .needs = {"bus_slot"},
          .paragraph =
              "Units that the bus starts late are not yet there when the exposure begins, or "
              "their move is cut: the error is against the motion and grows with the place in "
              "the start order. Wait for the last one.",
          .list = List,
          .apply = Apply,
          .continuous_shape = true};
}

}  // namespace focalfleet::sim
