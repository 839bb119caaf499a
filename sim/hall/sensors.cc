#include "sim/hall/sensors.h"

#include <algorithm>

namespace focalfleet::sim {
namespace {

// An output nearer than this to the supply or to ground counts as the end of its range.
constexpr double kRail_V = 2e-3;

}  // namespace

std::vector<HallSensor> SixSensors(const SensorAngles& angles) {
  const double cos_xy = std::cos(angles.pair_xy_rad), sin_xy = std::sin(angles.pair_xy_rad);
  const double cos_xz = std::cos(angles.pair_xz_rad), sin_xz = std::sin(angles.pair_xz_rad);
  const double cos_yz = std::cos(angles.pair_yz_rad), sin_yz = std::sin(angles.pair_yz_rad);
  std::vector<HallSensor> sensors;
  for (const Vector3& direction :
       {Vector3{cos_xy, sin_xy, 0}, Vector3{cos_xy, -sin_xy, 0}, Vector3{sin_xz, 0, cos_xz},
        Vector3{sin_xz, 0, -cos_xz}, Vector3{0, cos_yz, sin_yz}, Vector3{0, cos_yz, -sin_yz}})
    sensors.push_back({.direction = direction});
  return sensors;
}

std::vector<HallSensor> EightSensors(const SensorAngles& angles) {
  std::vector<HallSensor> sensors = SixSensors(angles);
  sensors.push_back({.direction = {1, 0, 0}});
  sensors.push_back({.direction = {0, 1, 0}});
  return sensors;
}

Vector3 Shifted(const Vector3& direction, const SensorShift& shift) {
  if (shift.east_rad == 0 && shift.north_rad == 0) return direction;
  const Vector3 across{-direction.y, direction.x, 0};
  // On the axis every direction is north, and any east will do.
  const Vector3 east = Length(across) > 1e-9 ? Unit(across) : Vector3{0, 1, 0};
  const Vector3 north = Cross(direction, east);
  return Unit(direction + shift.east_rad * east + shift.north_rad * north);
}

double Voltage_V(const HallSensor& sensor, const SensorElectronics& electronics, double b_T,
                 double noise) {
  double voltage_V =
      electronics.zero_V() + sensor.offset_V +
      electronics.sensitivity_V_per_T * sensor.gain * (b_T + noise * electronics.noise_T);
  if (electronics.clips) voltage_V = std::clamp(voltage_V, 0.0, electronics.supply_V);
  if (electronics.step_V > 0)
    voltage_V = std::round(voltage_V / electronics.step_V) * electronics.step_V;
  return voltage_V;
}

std::optional<double> Field_T(const HallSensor& sensor, const SensorElectronics& electronics,
                              double voltage_V) {
  if (electronics.clips && (voltage_V <= kRail_V || voltage_V >= electronics.supply_V - kRail_V))
    return std::nullopt;
  return (voltage_V - electronics.zero_V() - sensor.offset_V) /
         (electronics.sensitivity_V_per_T * sensor.gain);
}

}  // namespace focalfleet::sim
