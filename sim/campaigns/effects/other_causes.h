// Causes that show by exact places, by steps or by the motion of the image rather than by the
// signature of a template. The part of the diagnosis that finds one of them uses its name from
// here.
#pragma once

#include <string_view>

#include "sim/campaigns/effects/traits.h"

namespace focalfleet::sim {

inline constexpr std::string_view kZeroOffset = "zero_offset", kBaseOffset = "base_offset",
                                  kArmLength = "arm_length", kIdentitySwap = "identity_swap",
                                  kLostCommand = "lost_command", kStepLoss = "step_loss",
                                  kSensorBias = "sensor_bias", kAirTurbulence = "air_turbulence";

/// Effects of the registry that also show otherwise: arms that stop each other, and an image whose
/// motion is free in each exposure.
inline constexpr std::string_view kContact = "collision_contact",
                                  kCameraSimilarity = "camera_similarity";

/// The effect of the registry that moves the image like this. Pre: not kNone.
std::string_view CauseOf(MotionOfImage motion);

/// The traits of a cause, by its name: of an effect of the registry, or of one that shows
/// otherwise. A name that nobody has has no traits.
const Traits& TraitsOf(std::string_view cause);

}  // namespace focalfleet::sim
