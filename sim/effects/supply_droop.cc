// Supply droop: the rail sags with those that move at once.
#include <algorithm>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  ListGrid({}, out);
  ListGrid({.memories = {Memory::kNow}}, out);
  if (facts.Has("rail_slot")) ListGrid({.form = 1}, out);
  if (facts.Has("rail_slot")) ListGrid({.form = 2}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  const std::span<const double> movers = track.Column("movers_on_rail");
  const double most = std::max(track.facts->Find("movers_on_rail")->high, 1.0);
  std::span<const double> slot;
  double slots = 1;
  if (form.form != 0) slot = track.Column("rail_slot");
  if (form.form != 0) slots = std::max(track.facts->Find("rail_slot")->high, 0.0) + 1;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        double place = 1;
        if (form.form == 1) place = (slot[i] + 1) / slots;
        if (form.form == 2) place = 0.5 + slot[i] / slots;
        return -amplitude[0] * Direction(step[i]) * place * movers[i] / most;
      },
      &errors->angle_deg[axis]);
}

}  // namespace

Effect MakeSupplyDroop() {
  return {.cause = "supply_droop",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kRail,
          .needs = {"movers_on_rail"},
          .paragraph =
              "The more units move on one rail, and the farther along the harness a unit "
              "sits, the lower its voltage and the larger its lag. Move fewer at once, or "
              "feed the rail at both ends.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
