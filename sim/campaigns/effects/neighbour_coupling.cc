// Neighbour coupling: the neighbours' motors pull.
#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {
namespace {

void ListNeighbourCoupling(const CampaignFacts& facts, Templates* out) {
  if (facts.Has(kNeighbourTheta)) ListGrid({}, out);
}

void ApplyNeighbourCoupling(const UnitTrack& track, const Template& form,
                            std::span<const double> amplitude, PoseErrors* errors) {
  const std::size_t axis = AxisIndex(form);
  const std::span<const double> pull =
      track.Column(axis == kTheta ? kNeighbourTheta : kNeighbourPhi);
  for (std::size_t i = 0; i < track.moves; ++i)
    errors->angle_deg[axis][i] += amplitude[0] * pull[i];
}

}  // namespace

Effect MakeNeighbourCoupling() {
  return {.cause = "neighbour_coupling",
          .amplitude_unit = "deg",
          .prior_size = 0.01,
          .owner = Owner::kUnit,
          .needs = {},
          .paragraph =
              "The magnets of a neighbour's motor pull at this one's rotor, by the angle "
              "between the two and the cube of their distance.",
          .list = ListNeighbourCoupling,
          .apply = ApplyNeighbourCoupling};
}

}  // namespace focalfleet::sim
