// Plate expansion: the plate grows with temperature.
#include <cmath>

#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/thermal_mass.h"

namespace focalfleet::sim {
namespace {

void ListPlateExpansion(const CampaignFacts& facts, Templates* out) {
  out->push_back({.axis = EffectAxis::kNone, .label = "by each unit's temperature"});
  // A thick plate follows its units' temperature late.
  if (facts.Has("t_s"))
    ListGrid({.axes = {EffectAxis::kNone},
              .shapes = {300, 1200, 5000},
              .shape_name = "late by a time constant of, s,",
              .form = 1},
             out);
}

void ApplyPlateExpansion(const UnitTrack& track, const Template& form,
                         std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> temperature = track.Column("temp_C");
  const CampaignFacts& facts = *track.facts;
  const double usual_C = facts.Find("temp_C")->mean;
  std::vector<double> late;
  if (form.form == 1) late = Late(temperature, track.Column("t_s"), form.shape);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double strain = amplitude[0] * ((form.form == 1 ? late[i] : temperature[i]) - usual_C);
    errors->x_mm[i] += strain * track.fibre_x_mm[i];
    errors->y_mm[i] += strain * track.fibre_y_mm[i];
  }
}

}  // namespace

Effect MakePlateExpansion() {
  return {.cause = "plate_expansion",
          .amplitude_unit = "1/K",
          .prior_size = 5e-6,
          .owner = Owner::kPlate,
          .needs = {"temp_C"},
          .paragraph =
              "The focal plate grows with temperature and carries all units outwards, in "
              "proportion to their distance from its centre. Fiducials on the plate move with "
              "it.",
          .list = ListPlateExpansion,
          .apply = ApplyPlateExpansion,
          .continuous_shape = true,
          // Without temperatures a plate that grows is a camera that scales.
          .passes_for = {"camera_similarity"},
          .traits = {.image_motion = MotionOfImage::kGrows}};
}

}  // namespace focalfleet::sim
