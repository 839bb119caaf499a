// Friction wind-up: the drive train twists until friction gives way.
#include <cmath>
#include <iterator>
#include <span>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListFrictionWindup(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {0.5, 2, 6, 20}, .shape_name = "over a travel of, deg,"}, out);
}

void ApplyFrictionWindup(const UnitTrack& track, const Template& form,
                         std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> step = track.step_deg[axis];
  double twist = 0;
  AddRemembered(
      track, axis, form.memory,
      [&](std::size_t i) {
        if (track.restarts[i]) twist = 0;
        const double end = Direction(step[i]);
        twist = end - (end - twist) * std::exp(-std::abs(step[i]) / form.shape);
        return -amplitude[0] * twist;
      },
      &errors->angle_deg[axis]);
}

// The shape is how the lag grows with the size of the move: a bend would be another such shape.
constexpr auto kBesideSize = std::span(kOfMoves).first<std::size(kOfMoves) - 1>();
static_assert(*std::rbegin(kOfMoves) == Distortion::kBend);

}  // namespace

Effect MakeFrictionWindup() {
  return {.cause = "friction_windup",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Friction twists the drive train like a spring. After a reversal the twist "
              "unwinds and winds up the other way over some degrees of travel, so that short "
              "moves after a reversal err less than long ones.",
          .list = ListFrictionWindup,
          .apply = ApplyFrictionWindup,
          .of_poses_alone = EachForm,
          .continuous_shape = true,
          .distortions = kBesideSize};
}

}  // namespace focalfleet::sim
