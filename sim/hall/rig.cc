#include "sim/hall/rig.h"

#include "protocol/base/check.h"

namespace focalfleet::sim {

double TangentialShare(double decay) {
  constexpr double kL = kTypicalDegree;
  const double within = (decay + kL - 1) / (2 * kL + 1);
  return within / (kL + 1) - (1 - within) / kL;
}

HallRig::Seen HallRig::SeenFromRotor(const HallSensor& sensor) const {
  if (centre_mm.x == 0 && centre_mm.y == 0 && centre_mm.z == 0) return {sensor.direction, 1};
  const Vector3 away = (1 / radius_mm) * centre_mm;
  const double share = 1 + TangentialShare(decay);
  return {Unit(sensor.direction - share * away), std::pow(Length(sensor.direction - away), -decay)};
}

void PredictVoltages(const HallRig& rig, const FieldModel& field, const Orientation& orientation,
                     std::span<double> voltages_V) {
  const std::size_t count = rig.sensors.size();
  FOCALFLEET_CHECK(count <= kSensorsMax && voltages_V.size() == count);
  const Rotation rotation(orientation);
  std::array<Vector3, kSensorsMax> local;
  std::array<double, kSensorsMax> factor{};
  std::array<FieldSample, kSensorsMax> samples;
  for (std::size_t k = 0; k < count; ++k) {
    const HallRig::Seen seen = rig.SeenFromRotor(rig.sensors[k]);
    local[k] = rotation.ToRotor(seen.direction);
    factor[k] = seen.factor;
  }
  field.Evaluate({local.data(), count}, {samples.data(), count});
  for (std::size_t k = 0; k < count; ++k)
    voltages_V[k] =
        rig.electronics.zero_V() + rig.sensors[k].offset_V +
        rig.electronics.sensitivity_V_per_T * rig.sensors[k].gain * factor[k] * samples[k].b_T;
}

}  // namespace focalfleet::sim
