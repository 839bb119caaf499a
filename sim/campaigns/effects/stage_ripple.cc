// Stage ripple: a planetary stage inside the gearhead.
#include <cmath>

#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListStageRipple(const CampaignFacts&, Templates* out) {
  ListGrid({.shapes = {1, 2, 3}, .shape_name = "stages from the output:", .columns = 2}, out);
}

void ApplyStageRipple(const UnitTrack& track, const Template& form,
                      std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const double order = PinionRatio(*track.unit, axis) * std::pow(kStageRatio, form.shape);
  AddHarmonic(track, axis, order, amplitude, errors);
}

}  // namespace

Effect MakeStageRipple() {
  return {.cause = "stage_ripple",
          .amplitude_unit = "deg",
          .prior_size = 0.02,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "A carrier inside the planetary gearhead is off centre: a ripple with the order "
              "of its stage (11.3, 48.6 or 208 a turn with a pinion stage behind it).",
          .list = ListStageRipple,
          .apply = ApplyStageRipple,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
