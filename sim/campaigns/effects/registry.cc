#include "sim/campaigns/effects/registry.h"

#include <algorithm>

namespace focalfleet::sim {

const std::vector<Effect>& EffectLibrary() {
  static const std::vector<Effect> library = {
      MakeAxisCrosstalk(),
      MakeAxisTilt(),
      MakeBacklash(),
      MakeCameraDistortion(),
      MakeCameraSimilarity(),
      MakeCentroidBias(),
      MakeCogging(),
      MakeCollisionContact(),
      MakeCommandQuantisation(),
      MakeEccentricity(),
      MakeFibreTorque(),
      MakeFrictionWindup(),
      MakeGearScale(),
      MakeGravitySag(),
      MakeGravityTorque(),
      MakeHardStop(),
      MakeLoadAngleLag(),
      MakeModeThreshold(),
      MakeNeighbourCoupling(),
      MakePhaseImbalance(),
      MakePinionRunout(),
      MakePlateExpansion(),
      MakePlateGradient(),
      MakeRampTravel(),
      MakeRelaxation(),
      MakeScaleAsymmetry(),
      MakeSelfHeating(),
      MakeStageRipple(),
      MakeStartSkew(),
      MakeStiction(),
      MakeSupplyDrift(),
      MakeSupplyDroop(),
      MakeThermalArmGrowth(),
      MakeThermalBacklash(),
      MakeToothDamage(),
      MakeToothMesh(),
      MakeWear(),
  };
  return library;
}

const Effect* FindEffect(std::string_view cause) {
  for (const Effect& effect : EffectLibrary())
    if (effect.cause == cause) return &effect;
  return nullptr;
}

std::string_view MissingCovariate(const Effect& effect, const CampaignFacts& facts) {
  const auto missing =
      std::ranges::find_if(effect.needs, [&](std::string_view name) { return !facts.Has(name); });
  if (missing == effect.needs.end()) return {};
  const bool has_one =
      std::ranges::any_of(effect.needs, [&](std::string_view name) { return facts.Has(name); });
  return effect.one_is_enough && has_one ? std::string_view{} : *missing;
}

Templates ListTemplates(const Effect& effect, const CampaignFacts& facts) {
  Templates templates;
  if (!MissingCovariate(effect, facts).empty()) return templates;
  effect.list(facts, &templates);
  for (Template& made : templates) made.effect = &effect;
  return templates;
}

bool IsOffered(const Template& form, const CampaignFacts& facts) {
  const Templates listed = ListTemplates(*form.effect, facts);
  const int asked = form.form == form.effect->form_of_found_shapes ? 0 : form.form;
  return std::any_of(listed.begin(), listed.end(), [&](const Template& one) {
    return one.form == asked && one.axis == form.axis && one.memory == form.memory &&
           one.columns == form.columns;
  });
}

}  // namespace focalfleet::sim
