// Plate expansion: the plate grows with temperature.
#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  (void)facts;
  out->push_back({.axis = EffectAxis::kNone, .label = "by each unit's temperature"});
}

void Apply(const UnitTrack& track, const Template&, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::span<const double> temperature = track.Column("temp_C");
  const CampaignFacts& facts = *track.facts;
  const double usual_C = facts.Find("temp_C")->mean;
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double strain = amplitude[0] * (temperature[i] - usual_C);
    errors->x_mm[i] += strain * (track.fibre_x_mm[i] - facts.centre_x_mm);
    errors->y_mm[i] += strain * (track.fibre_y_mm[i] - facts.centre_y_mm);
  }
}

}  // namespace

Effect MakePlateExpansion() {
  return {.cause = "plate_expansion",
          .amplitude_unit = "1/K",
          .prior_size = 2e-6,
          .owner = Owner::kPlate,
          .needs = {"temp_C"},
          .paragraph =
              "The focal plate grows with temperature and carries all units outwards, in "
              "proportion to their distance from its centre. Fiducials on the plate move with "
              "it.",
          .list = List,
          .apply = Apply};
}

}  // namespace focalfleet::sim
