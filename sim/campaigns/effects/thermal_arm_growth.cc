// Thermal arm growth: the arms are longer when warm.
#include <iterator>

#include "sim/campaigns/effects/registry.h"
#include "sim/campaigns/effects/thermal_mass.h"

namespace focalfleet::sim {
namespace {

void ListThermalArmGrowth(const CampaignFacts& facts, Templates* out) {
  const std::vector<EffectAxis> arms = {EffectAxis::kBoth, EffectAxis::kTheta, EffectAxis::kPhi};
  ListGrid({.axes = arms}, out);
  if (facts.Has("t_s"))
    ListGrid({.axes = arms,
              .shapes = {std::begin(kTimeConstants_s), std::end(kTimeConstants_s)},
              .shape_name = "late by a time constant of, s,",
              .form = 1},
             out);
}

void ApplyThermalArmGrowth(const UnitTrack& track, const Template& form,
                           std::span<const double> amplitude, PoseErrors* errors) {
  const std::span<const double> temperature = track.Column("temp_C");
  const double usual_C = track.facts->Find("temp_C")->mean;
  std::vector<double> late;
  if (form.form == 1) late = Late(temperature, track.Column("t_s"), form.shape);
  for (const std::size_t axis : {kTheta, kPhi}) {
    if (form.axis == (axis == kTheta ? EffectAxis::kPhi : EffectAxis::kTheta)) continue;
    for (std::size_t i = 0; i < track.moves; ++i)
      errors->arm_mm[axis][i] += amplitude[0] * track.unit->arm_mm[axis] *
                                 ((form.form == 1 ? late[i] : temperature[i]) - usual_C);
  }
}

}  // namespace

Effect MakeThermalArmGrowth() {
  return {.cause = "thermal_arm_growth",
          .amplitude_unit = "1/K",
          .prior_size = 2.3e-5,
          .owner = Owner::kUnit,
          .needs = {"temp_C"},
          .paragraph =
              "Both arms grow with temperature (aluminium: 23 parts in a million a kelvin). "
              "The error is along the arms and follows the unit's temperature.",
          .list = ListThermalArmGrowth,
          .apply = ApplyThermalArmGrowth,
          .continuous_shape = true,
          // Without temperatures arms that grow over a night are warmed by their motors.
          .passes_for = {"self_heating"}};
}

}  // namespace focalfleet::sim
