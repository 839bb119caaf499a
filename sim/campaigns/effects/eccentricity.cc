// Eccentricity: the output gear runs out of true.
#include "sim/campaigns/effects/harmonic.h"
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListEccentricity(const CampaignFacts&, Templates* out) { ListGrid({.columns = 2}, out); }

void ApplyEccentricity(const UnitTrack& track, const Template& form,
                       std::span<const double> amplitude, PoseErrors* errors) {
  AddHarmonic(track, AxisIndex(form), 1.0, amplitude, errors);
}

}  // namespace

Effect MakeEccentricity() {
  return {.cause = "eccentricity",
          .amplitude_unit = "deg",
          .prior_size = 0.1,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The output gear or its bearing is off centre, so that the angle errs as a sine "
              "of one period a turn, the same in both directions. Its phase is the unit's "
              "own.",
          .list = ListEccentricity,
          .apply = ApplyEccentricity,
          .of_poses_alone = EachForm};
}

}  // namespace focalfleet::sim
