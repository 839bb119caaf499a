// Pinion runout: the pinion or the last carrier runs out of true.
#include "sim/effects/harmonic.h"
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  if (HasPinion(facts)) ListGrid({.columns = 2}, out);
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  AddHarmonic(track, AxisIndex(form), PinionRatio(*track.unit, AxisIndex(form)), amplitude, errors);
}

}  // namespace

Effect MakePinionRunout() {
  return {.cause = "pinion_runout",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The pinion of the output stage, or the carrier that it sits on, is off centre: "
              "a ripple of 2.65 periods a turn. The two turn together, so that nothing but a "
              "gear of its own tells them apart.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
