// Vectors, angles and time of an axis. A vector turns the motor's field by 360/subdivision degrees.
// A vector lasts V_counter2 = n * V_counter1 timer counts at 144 MHz (paper 1, section "Open loop
// regulating process"). Example: V_counter1 = 500, n = 108, subdivision 96 and a gear of 337 *
// 45/17. A turn of the axis then takes 32.11 s and one vector is 4.2 mdeg. All motions on the bus
// are whole vectors.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "fleet/layout.h"
#include "protocol/base/ids.h"
#include "protocol/base/instants.h"

namespace focalfleet {

inline constexpr double kTimerHz = 144e6;

struct AxisDrive {
  std::uint16_t counter1 = 500;    // timer counts per carrier period, V_counter1
  std::uint8_t repeat = 108;       // carrier periods per vector, n
  std::uint16_t subdivision = 96;  // vectors per electrical turn
  constexpr bool operator==(const AxisDrive&) const = default;
};

struct UnitDrive {
  std::array<AxisDrive, kAxisCount> axis;
  WaveMode mode = WaveMode::kAsymmetric;
  double v_bus_V = 1.8;
};

/// The place of both axes: whole vectors from each axis' zero.
using Pose = std::array<std::int32_t, kAxisCount>;

constexpr double DegreesPerVector(const AxisGeometry& axis, const AxisDrive& drive) {
  return 360.0 / (drive.subdivision * axis.gear);
}
constexpr double SecondsPerVector(const AxisDrive& drive) {
  return drive.repeat * static_cast<double>(drive.counter1) / kTimerHz;
}
inline std::int32_t NearestVectors(double angle_deg, const AxisGeometry& axis,
                                   const AxisDrive& drive) {
  return static_cast<std::int32_t>(std::lround(angle_deg / DegreesPerVector(axis, drive)));
}
inline double AngleDeg(std::int32_t vectors, const AxisGeometry& axis, const AxisDrive& drive) {
  return vectors * DegreesPerVector(axis, drive);
}

}  // namespace focalfleet
