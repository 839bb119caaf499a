// Start skew: units late in the start order are still moving.
#include <algorithm>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

// Forms of the templates.
enum SkewForm {
  kStraight,       // the missing way grows with the slot, from a share of the slots on
  kStraightEarly,  // the same, in exposures that do not wait for the end of a move
  kBraking,        // a unit that is cut off while braking misses little: its speed falls to nothing
  kRace,           // the missing way grows with the time by which the start comes after the delay
};

void ListStartSkew(const CampaignFacts& facts, Templates* out) {
  const std::vector<EffectAxis> axes = {EffectAxis::kTheta, EffectAxis::kPhi, EffectAxis::kBoth};
  const std::vector<double> shapes = {0, 0.25, 0.5, 0.75};
  ListGrid({.axes = axes,
            .memories = {Memory::kHold, Memory::kNow},
            .shapes = shapes,
            .shape_name = "from this share of the slots:"},
           out);
  ListGrid({.axes = axes,
            .memories = {Memory::kHold, Memory::kNow},
            .shapes = {0.25, 0.5, 1},
            .shape_name = "cut while braking, over this share of the slots:",
            .form = kBraking},
           out);
  // An exposure with a longer delay sees the end of every move.
  if (facts.Has("delay_s") && facts.Find("delay_s")->varies())
    ListGrid({.axes = axes,
              .memories = {Memory::kNow},
              .shapes = shapes,
              .shape_name = "in exposures within a second; from this share of the slots:",
              .form = kStraightEarly},
             out);
  // The last unit of the bus starts so late. An exposure that waits longer sees its whole move.
  if (facts.Has("delay_s"))
    ListGrid({.axes = axes,
              .memories = {Memory::kNow},
              .shapes = {0.3, 0.6, 1.2, 2.5, 5},
              .shape_name = "the exposure does not wait; the last unit starts after, s,",
              .form = kRace},
             out);
}

// Slots are shares from 0 to 1. A skew that begins below 0 is a play for all units, and two of them
// cancel.
bool ShowsStartSkew(const Template& form, const CampaignFacts& facts) {
  if (form.form == kRace) return form.shape > std::max(facts.Find("delay_s")->low, 0.0);
  if (form.form == kBraking) return form.shape > 0 && form.shape <= 1;
  return form.shape >= 0 && form.shape < 1;
}

// The missing way of a move that is cut `late` before its end, as a share of what the last unit in
// the order misses. The share goes with the square of the time while the unit brakes, then in a
// straight line.
double MissingOfBraking(double late, double braking) {
  const double missing = late < braking ? late * late / (2 * braking) : late - braking / 2;
  return missing / (1 - braking / 2);
}

void ApplyStartSkew(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
                    PoseErrors* errors) {
  constexpr double kEarly_s = 1;
  const std::span<const double> slot = track.Column("bus_slot");
  const double last = std::max(track.facts->Find("bus_slot")->high, 1.0);
  std::span<const double> delay;
  if (form.form == kStraightEarly || form.form == kRace) delay = track.Column("delay_s");
  for (const std::size_t axis : AxesOf(form)) {
    const std::span<const double> step = track.step_deg[axis];
    AddRemembered(
        track, axis, form.memory,
        [&](std::size_t i) {
          if (form.form == kStraightEarly && delay[i] > kEarly_s) return 0.0;
          if (form.form == kRace) {
            const double late = std::max(slot[i] / last - delay[i] / form.shape, 0.0);
            return -Direction(step[i]) * amplitude[0] * late;
          }
          const double missing = form.form == kBraking
                                     ? MissingOfBraking((slot[i] + 1) / (last + 1), form.shape)
                                     : std::max(slot[i] / last - form.shape, 0.0);
          return -amplitude[0] * Direction(step[i]) * missing;
        },
        &errors->angle_deg[axis]);
  }
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
          .list = ListStartSkew,
          .apply = ApplyStartSkew,
          .continuous_shape = true,
          .distortions = kOfMoves,
          .shows = ShowsStartSkew,
          .traits = {.by_direction = true}};
}

}  // namespace focalfleet::sim
