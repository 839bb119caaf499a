// Supply droop: the rail sags with those that move at once.
#include <algorithm>
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

constexpr int kLoadedByPlace = 4;
constexpr int kLoadedEvenly = 5;

void List(const CampaignFacts& facts, Templates* out) {
  // Form 0: the whole rail alike; else by the place along the harness, which has the movers evenly
  // along it in form 3.
  const std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi, EffectAxis::kBoth};
  ListGrid({.axes = axes}, out);
  ListGrid({.axes = axes, .memories = {Memory::kNow}}, out);
  if (!facts.Has("rail_slot")) return;
  for (const int form : {1, 2, 3}) ListGrid({.axes = axes, .form = form}, out);
  // A rotor under load: its angle is an arcsine of what the drive has left, and a deep droop bends.
  if (!facts.Has("drive_amplitude")) return;
  for (const int form : {kLoadedByPlace, kLoadedEvenly})
    ListGrid({.axes = axes,
              .shapes = {0.2, 0.4, 0.55},
              .shape_name = form == kLoadedByPlace
                                ? "load, of the pull-out at nominal drive,"
                                : "movers evenly along the rail; load, of the pull-out,",
              .form = form,
              .columns = 2},
             out);
}

// Place along the harness: how much of the rail's droop a unit has.
double ShareOfDroop(int form, double slot, double slots) {
  const double share = (slot + 1) / slots;
  if (form == 0) return 1;
  if (form == 1 || form == kLoadedByPlace) return share;
  if (form == 2) return 0.5 + slot / slots;
  return 0.1 + share * (1 - share / 2);
}

// asin(x / (1 - droop)) - asin(x), x = load / drive, to second order in the droop.
struct LoadedLag {
  double first = 0;
  double second = 0;
};
LoadedLag LagOf(double load, double level) {
  constexpr double kPullOut = 0.95;  // beyond it the rotor slips, which is another cause
  const double x = std::min(load / level, kPullOut);
  const double left = 1 - x * x;
  return {x / std::sqrt(left), x * (2 - x * x) / (2 * std::pow(left, 1.5))};
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
  const bool loaded = form.form == kLoadedByPlace || form.form == kLoadedEvenly;
  for (const std::size_t axis : AxesOf(form)) {
    const std::span<const double> step = track.step_deg[axis];
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) {
          const double droop =
              ShareOfDroop(form.form, slot.empty() ? 0 : slot[i], slots) * movers[i] / most;
          const double level = drive.empty() ? 1 : std::max(drive[i], 0.05);
          // The load angle grows with what the drive lacks.
          double lag = amplitude[0] * droop / level;
          if (loaded) {
            const auto [first, second] = LagOf(form.shape, level);
            lag = amplitude[0] * droop * first + amplitude[1] * droop * droop * second;
          }
          return -Direction(step[i]) * lag;
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
