#include "sim/campaigns/effects/other_causes.h"

#include <map>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {

const Traits& TraitsOf(std::string_view cause) {
  static const std::map<std::string_view, Traits> others = {
      {kZeroOffset, {.families = {}, .is_static = true, .is_found_exactly = true}},
      {kBaseOffset, {.families = {}, .is_static = true, .is_found_exactly = true}},
      {kArmLength, {.families = {}, .is_static = true, .is_found_exactly = true}},
      {kIdentitySwap, {.families = {}, .is_found_exactly = true}},
      {kLostCommand, {.families = {}, .is_found_exactly = true}},
      {kStepLoss, {.families = {}, .is_found_exactly = true}},
      {kSensorBias, {.families = {}, .is_found_exactly = true}},
      {kAirTurbulence, {.families = {Family::kImage}, .is_of_air = true}}};
  static const Traits none;
  if (const auto other = others.find(cause); other != others.end()) return other->second;
  const Effect* effect = FindEffect(cause);
  return effect != nullptr ? effect->traits : none;
}

std::string_view CauseOf(MotionOfImage motion) {
  return std::ranges::find_if(
             EffectLibrary(),
             [&](const Effect& effect) { return effect.traits.image_motion == motion; })
      ->cause;
}

}  // namespace focalfleet::sim
