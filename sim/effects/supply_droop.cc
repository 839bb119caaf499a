// Supply droop: the rail sags with those that move at once.
#include <algorithm>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  // Form 0: the whole rail alike; else by the place along the harness, which has the movers evenly
  // along it in form 3.
  const std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi, EffectAxis::kBoth};
  ListGrid({.axes = axes}, out);
  ListGrid({.axes = axes, .memories = {Memory::kNow}}, out);
  if (!facts.Has("rail_slot")) return;
  for (const int form : {1, 2, 3}) ListGrid({.axes = axes, .form = form}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::span<const double> movers = track.Column("movers_on_rail");
  const double most = std::max(track.facts->Find("movers_on_rail")->high, 1.0);
  std::span<const double> slot;
  std::span<const double> drive;
  double slots = 1;
  if (form.form != 0) slot = track.Column("rail_slot");
  if (form.form != 0) slots = std::max(track.facts->Find("rail_slot")->high, 0.0) + 1;
  if (track.facts->Has("drive_amplitude")) drive = track.Column("drive_amplitude");
  for (const std::size_t axis : AxesOf(form)) {
    const std::span<const double> step = track.step_deg[axis];
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) {
          double place = 1;
          if (form.form == 1) place = (slot[i] + 1) / slots;
          if (form.form == 2) place = 0.5 + slot[i] / slots;
          const double share = form.form == 3 ? (slot[i] + 1) / slots : 0;
          if (form.form == 3) place = 0.1 + share * (1 - share / 2);
          // The load angle grows with what the drive lacks.
          const double level = drive.empty() ? 1 : std::max(drive[i], 0.05);
          return -amplitude[0] * Direction(step[i]) * place * movers[i] / most / level;
        },
        &errors->angle_deg[axis]);
  }
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
