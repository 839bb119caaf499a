// Supply droop: the rail's voltage sags with the number of units that move at once.
#include <algorithm>
#include <cmath>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "sim/campaigns/effects/load_angle.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Forms from here on give the feed's share of the droop, and its depth. The depth is the share of
// the voltage that is missing at the harness' end with all units in motion.
constexpr int kLoaded = 4;
struct Named {
  double value;
  const char* name;
};
constexpr Named kFeeds[] = {{0, "harness"}, {0.5, "harness and feed"}, {1, "feed"}};
constexpr Named kDepths[] = {{0.05, ""}, {0.3, ", deep"}, {0.55, ", deeper"}};
// Forms from here on have the feed's share alone, for an axis whose lag does not depend on its
// drive.
constexpr int kUndriven = kLoaded + static_cast<int>(std::size(kFeeds) * std::size(kDepths));
// Forms from here on have the feed's share under load again. They are so deep that a part of the
// motors in motion is enough for the pull-out, and more of them add nothing.
constexpr int kToPullOut = kUndriven + static_cast<int>(std::size(kFeeds));
constexpr double kDepthToPullOut = 2.5;

void ListSupplyDroop(const CampaignFacts& facts, Templates* out) {
  // Form 0 is the whole rail alike. The others go by the place along the harness, which has the
  // movers evenly along it in form 3.
  const std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi, EffectAxis::kBoth};
  ListGrid({.axes = axes}, out);
  ListGrid({.axes = axes, .memories = {Memory::kNow}}, out);
  if (!facts.Has("rail_slot")) return;
  for (const int form : {1, 2, 3}) ListGrid({.axes = axes, .form = form}, out);
  // The current of each motor flows through the harness, and the rotor is under load. Its angle is
  // an arcsine of the drive that is left, which bends at a deep droop.
  if (!facts.Has("drive_amplitude") || !facts.Has(kSharedMotors)) return;
  int form = kLoaded;
  const auto list_loaded = [&](const Named& feed, const char* depth) {
    const std::string name = std::string(feed.name) + depth + "; load, of the pull-out,";
    ListGrid({.axes = axes, .shapes = {0.2, 0.4, 0.6}, .shape_name = name, .form = form++}, out);
  };
  for (const Named& feed : kFeeds)
    for (const Named& depth : kDepths) list_loaded(feed, depth.name);
  for (const Named& feed : kFeeds) {
    const std::size_t listed = out->size();
    ListGrid({.axes = axes, .form = form++}, out);
    for (std::size_t k = listed; k < out->size(); ++k)
      (*out)[k].label += std::string(", ") + feed.name + ", at any drive";
  }
  for (const Named& feed : kFeeds) list_loaded(feed, ", to the pull-out");
}

// Share of the largest droop, by the place along the harness.
std::vector<double> ByPlace(const UnitTrack& track, int form) {
  const std::span<const double> movers = track.Column("movers_on_rail");
  const double most = std::max(track.facts->Find("movers_on_rail")->high, 1.0);
  std::vector<double> droop(movers.begin(), movers.end());
  for (double& one : droop) one /= most;
  if (form == 0) return droop;
  const std::span<const double> slot = track.Column("rail_slot");
  const double slots = std::max(track.facts->Find("rail_slot")->high, 0.0) + 1;
  for (std::size_t i = 0; i < droop.size(); ++i) {
    const double place = (slot[i] + 1) / slots;
    droop[i] *= form == 1   ? place
                : form == 2 ? 0.5 + slot[i] / slots
                            : 0.1 + place * (1 - place / 2);
  }
  return droop;
}

// Share of the largest droop, by the motors whose current goes through the unit's part of the
// harness.
std::vector<double> ByCurrent(const UnitTrack& track, double feed_share) {
  const std::span<const double> motors = track.Column(kRailMotors);
  const std::span<const double> shared = track.Column(kSharedMotors);
  const double most = std::max(track.facts->Find(kRailMotors)->high, 1.0);
  const double most_shared = std::max(track.facts->Find(kSharedMotors)->high, 1e-9);
  std::vector<double> droop(motors.size());
  for (std::size_t i = 0; i < droop.size(); ++i)
    droop[i] = feed_share * motors[i] / most + (1 - feed_share) * shared[i] / most_shared;
  return droop;
}

// The model of the droop that a form stands for.
struct Way {
  bool loaded = false, driven = true;
  double feed_share = 0;  // below 0: by the place along the harness
  double depth = 0;
};
Way WayOf(int form) {
  if (form < kLoaded) return {.feed_share = -1};
  if (form >= kToPullOut)
    return {
        .loaded = true, .feed_share = kFeeds[form - kToPullOut].value, .depth = kDepthToPullOut};
  if (form >= kUndriven) return {.driven = false, .feed_share = kFeeds[form - kUndriven].value};
  const auto k = static_cast<std::size_t>(form - kLoaded);
  return {.loaded = true,
          .feed_share = kFeeds[k / std::size(kDepths)].value,
          .depth = kDepths[k % std::size(kDepths)].value};
}

void ApplySupplyDroop(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const Way way = WayOf(form.form);
  const std::vector<double> droop =
      way.feed_share < 0 ? ByPlace(track, form.form) : ByCurrent(track, way.feed_share);
  std::span<const double> drive;
  if (track.facts->Has("drive_amplitude") && way.driven) drive = track.Column("drive_amplitude");
  for (const std::size_t axis : AxesOf(form)) {
    const std::span<const double> step = track.step_deg[axis];
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) {
          const double level = drive.empty() ? 1 : std::max(drive[i], kDriveLeast);
          // The load angle grows with the missing part of the drive.
          const double lag =
              way.loaded ? AddedLoadAngle(form.shape, level, way.depth * droop[i]) / way.depth
                         : droop[i] / level;
          return -amplitude[0] * Direction(step[i]) * lag;
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
          .list = ListSupplyDroop,
          .apply = ApplySupplyDroop,
          .continuous_shape = true,
          .distortions = kOfMoves,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
