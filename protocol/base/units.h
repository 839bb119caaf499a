// Factors between units. Values at a door are in mm, um and degrees, as their names say; formulas
// take what they need.
#pragma once

#include <numbers>

namespace focalfleet {

inline constexpr double kRadiansPerDegree = std::numbers::pi / 180;
inline constexpr double kTurnDeg = 360;
inline constexpr double kTurnRad = 2 * std::numbers::pi;
inline constexpr double kUmPerMm = 1e3;

}  // namespace focalfleet
