// Orientation in closed form, as the paper computes it: no iteration, few sensors, and the error of
// the underlying model. The printed equations are lost. The ones here are derived from the paper's
// models and checked against its surviving fragments. Voltages stand for fields, pole signs
// included.
//
// Six sensors, harmonic model (sin^4 theta): with q = (V5 / V6)^(1/4) and the pair at +-a from the
// equator, tan alpha = (q - 1) / (q + 1) cot a at beta = 0; beta likewise from 3 and 4 with the
// other sign. Surface model: alpha = c^2 / (4 a) ln(V5 / V6). Eight sensors, width c unknown: alpha
// = (a / 2) ln(V5 / V6) / ln(V8^2 / (V5 V6)); beta with 3, 4, 7. gamma from 1 and 2 at zero tilt:
// tan 4 gamma = (V1 - V2) / (V1 + V2) / tan 4 a0.
//
// A ratio that is not positive has no logarithm: the pair stands beyond a pole's edge (gamma about
// +-22.5 deg). The closed form then fails and returns nothing. Source: [HallOrientation2014]
// "Derivation of orientation", reconstructed.
#pragma once

#include <optional>
#include <span>

#include "sim/hall/sensors.h"

namespace focalfleet::sim {

/// Shape: six fields. Frame: stator. Units: T.
std::optional<Orientation> OrientByHarmonic(std::span<const double> b_T,
                                            const SensorAngles& angles);
/// Shape: six fields.
std::optional<Orientation> OrientBySurface(std::span<const double> b_T, const SensorAngles& angles,
                                           double width_rad);
/// Shape: eight fields.
std::optional<Orientation> OrientBySurfaceOfAnyWidth(std::span<const double> b_T,
                                                     const SensorAngles& angles);

}  // namespace focalfleet::sim
