// Collision contact: two arms press against each other.
#include <algorithm>
#include <numbers>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListCollisionContact(const CampaignFacts& facts, Templates* out) {
  if (!facts.Has(kArmGap)) return;
  ListGrid({.axes = {EffectAxis::kPhi},
            .shapes = {0.08, 0.12, 0.16, 0.24},
            .shape_name = "arms as thick as, pitches,"},
           out);
}

void ApplyCollisionContact(const UnitTrack& track, const Template& form,
                           std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> gap_mm = track.Column(kArmGap);
  const std::span<const double> side = track.Column(kArmGapSide);
  const double thick_mm = form.shape * track.facts->pitch_mm;
  const double degrees = 180 / std::numbers::pi / track.unit->arm_mm[kPhi];
  // Each arm yields by half of the overlap.
  for (std::size_t i = 0; i < track.moves; ++i)
    errors->angle_deg[kPhi][i] +=
        amplitude[0] * side[i] * std::max(thick_mm - gap_mm[i], 0.0) / 2 * degrees;
}

}  // namespace

Effect MakeCollisionContact() {
  return {.cause = "collision_contact",
          .amplitude_unit = "share of the overlap",
          .prior_size = 0.1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "Neighbouring arms touch, and phi is pushed aside by what they overlap: move "
              "these targets apart, and look at the arms.",
          .list = ListCollisionContact,
          .apply = ApplyCollisionContact,
          .continuous_shape = true,
          .amplitude_low = 0,
          .amplitude_high = 1.5,
          .traits = {.acts_on_others = true}};
}

}  // namespace focalfleet::sim
