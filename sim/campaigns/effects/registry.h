// The library of effects. A new effect is a file of its own with one Make function, and its line
// here.
#pragma once

#include <string_view>
#include <vector>

#include "sim/campaigns/effects/effect.h"

namespace focalfleet::sim {

Effect MakeAxisCrosstalk();
Effect MakeAxisTilt();
Effect MakeBacklash();
Effect MakeCameraDistortion();
Effect MakeCameraSimilarity();
Effect MakeCentroidBias();
Effect MakeCogging();
Effect MakeCollisionContact();
Effect MakeCommandQuantisation();
Effect MakeEccentricity();
Effect MakeFibreTorque();
Effect MakeFrictionWindup();
Effect MakeGearScale();
Effect MakeGravitySag();
Effect MakeGravityTorque();
Effect MakeHardStop();
Effect MakeLoadAngleLag();
Effect MakeModeThreshold();
Effect MakeNeighbourCoupling();
Effect MakePhaseImbalance();
Effect MakePinionRunout();
Effect MakePlateExpansion();
Effect MakePlateGradient();
Effect MakeRampTravel();
Effect MakeRelaxation();
Effect MakeScaleAsymmetry();
Effect MakeSelfHeating();
Effect MakeStageRipple();
Effect MakeStartSkew();
Effect MakeStiction();
Effect MakeSupplyDrift();
Effect MakeSupplyDroop();
Effect MakeThermalArmGrowth();
Effect MakeThermalBacklash();
Effect MakeToothDamage();
Effect MakeToothMesh();
Effect MakeWear();

/// All effects, by cause.
const std::vector<Effect>& EffectLibrary();

/// The effect of that name, or nullptr.
const Effect* FindEffect(std::string_view cause);

/// The effect's templates in this campaign, with `effect` set. Empty where a covariate is missing,
/// or where no template can be built from these data.
Templates ListTemplates(const Effect& effect, const CampaignFacts& facts);
/// Whether the effect offers the template's axis, form, memory and columns in this campaign, at any
/// shape. A form whose shapes are found from moves is offered where the effect's first form is: the
/// template has its shapes, by these moves or by others.
bool IsOffered(const Template& form, const CampaignFacts& facts);

/// The first covariate that the effect needs and the campaign lacks; empty where none is missing.
std::string_view MissingCovariate(const Effect& effect, const CampaignFacts& facts);

}  // namespace focalfleet::sim
