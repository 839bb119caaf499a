#include "sim/campaigns/effects/other_causes.h"

#include <algorithm>
#include <map>

#include "sim/campaigns/effects/registry.h"

namespace focalfleet::sim {

const Traits& TraitsOf(std::string_view cause) {
  static const std::map<std::string_view, Traits> others = {{kZeroOffset, {.is_static = true}},
                                                            {kBaseOffset, {.is_static = true}},
                                                            {kArmLength, {.is_static = true}}};
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
