// Plate expansion: the plate grows with temperature.
#include <cmath>

#include "sim/effects/registry.h"

namespace focalfleet::sim {
namespace {

void List(const CampaignFacts& facts, Templates* out) {
  out->push_back({.axis = EffectAxis::kNone, .label = "by each unit's temperature"});
  // A thick plate follows its units' temperature late.
  if (facts.Has("t_s"))
    ListGrid({.axes = {EffectAxis::kNone},
              .shapes = {300, 1200, 5000},
              .shape_name = "late by a time constant of, s,",
              .form = 1},
             out);
}

// The temperature behind a thermal mass, from rest at the first exposure.
std::vector<double> Late(std::span<const double> temperature, std::span<const double> time,
                         double tau_s) {
  std::vector<double> late(temperature.begin(), temperature.end());
  for (std::size_t i = 1; i < late.size(); ++i) {
    const double kept = std::exp(-std::max(time[i] - time[i - 1], 0.0) / tau_s);
    late[i] = kept * late[i - 1] + (1 - kept) * (temperature[i] + temperature[i - 1]) / 2;
  }
  return late;
}

void Apply(const UnitTrack& track, const Template& form, std::span<const double> amplitude,
           PoseErrors* errors) {
  const std::span<const double> temperature = track.Column("temp_C");
  const CampaignFacts& facts = *track.facts;
  const double usual_C = facts.Find("temp_C")->mean;
  std::vector<double> late;
  if (form.form == 1) late = Late(temperature, track.Column("t_s"), form.shape);
  for (std::size_t i = 0; i < track.moves; ++i) {
    const double strain = amplitude[0] * ((form.form == 1 ? late[i] : temperature[i]) - usual_C);
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
          .apply = Apply,
          .continuous_shape = true};
}

}  // namespace focalfleet::sim
