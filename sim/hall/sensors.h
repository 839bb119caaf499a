// Radial Hall sensors around a rotor, and their outputs: V = half of the supply + sensitivity times
// the radial flux density, within the supply. 2.5 mV/G = 25 V/T about 2.5 V leaves +-0.1 T between
// 0 and 5 V; the +-0.8 T that the paper states beside it would need 20 V.
//
// Frame: stator. Directions are unit vectors from the joint's centre; a sensor is `radius_mm` away
// from it and measures along its own direction. Source: [HallOrientation2014] sections
// "Distribution of Hall-effect sensors", "Methods".
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/rng.h"
#include "sim/hall/rotation.h"

namespace focalfleet::sim {

inline constexpr std::size_t kSensorsMax = 16;
inline constexpr double kSensorRadius_mm = 59;

struct HallSensor {
  Vector3 direction{1, 0, 0};
  double gain = 1;      // times the nominal sensitivity
  double offset_V = 0;  // from half of the supply
};

struct SensorElectronics {
  double supply_V = 5;
  double sensitivity_V_per_T = 25;
  double step_V = 0;   // of the converter; 0: none
  double noise_T = 0;  // standard deviation, referred to the input
  bool clips = true;   // at 0 and at the supply

  [[nodiscard]] double zero_V() const { return supply_V / 2; }
  [[nodiscard]] double range_T() const { return supply_V / 2 / sensitivity_V_per_T; }
};

/// The angles of the paper's figure 2: sensors 1 and 2 from X, 3 and 4 from Z, 5 and 6 from Y.
struct SensorAngles {
  double pair_xy_rad = 11.25 * kRadPerDeg;
  double pair_xz_rad = 75 * kRadPerDeg;
  double pair_yz_rad = 15 * kRadPerDeg;
};
/// Sensors 1 to 6; 4 mirrors 3 in the plane XY.
std::vector<HallSensor> SixSensors(const SensorAngles& angles = {});
/// The six sensors, and 7 on X, 8 on Y.
std::vector<HallSensor> EightSensors(const SensorAngles& angles = {});

/// A shift along growing longitude, and one towards +Z.
struct SensorShift {
  double east_rad = 0;
  double north_rad = 0;
};
/// The direction moved along the sphere, to first order.
Vector3 Shifted(const Vector3& direction, const SensorShift& shift);

/// The output of a sensor in a field. `noise` in standard deviations.
double Voltage_V(const HallSensor& sensor, const SensorElectronics& electronics, double b_T,
                 double noise = 0);

/// The field that a voltage stands for. None: the output is at an end of its range.
std::optional<double> Field_T(const HallSensor& sensor, const SensorElectronics& electronics,
                              double voltage_V);

}  // namespace focalfleet::sim
