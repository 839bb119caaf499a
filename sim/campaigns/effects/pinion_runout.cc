// Pinion runout: the pinion or the last carrier runs out of true.
#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListPinionRunout(const CampaignFacts&, Templates* out) { ListGrid({.columns = 2}, out); }

// Without an output stage the last pinion is the sun of the last planetary stage.
void ApplyPinionRunout(const UnitTrack& track, const Template& form,
                       std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double ratio = PinionRatio(*track.unit, axis);
  AddHarmonic(track, axis, ratio > 1 ? ratio : kStageRatio, amplitude, errors);
}

}  // namespace

Effect MakePinionRunout() {
  return {.cause = "pinion_runout",
          .amplitude_unit = "deg",
          .prior_size = 0.05,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The last pinion, or the carrier that it sits on, is off centre: a ripple of 2.65 "
              "periods a turn with an output stage, of 4.29 without. The two turn together, so "
              "that nothing but a gear of its own tells them apart.",
          .list = ListPinionRunout,
          .apply = ApplyPinionRunout,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
