// A rig puts sensors, electronics, joint and field together: it gives the outputs of its Hall
// sensors at an orientation. Calibration lives here alone. Rotor and sensors may be not concentric:
// the rotor's centre is off the sensors' by d. A sensor then stands elsewhere in the rotor's field,
// and its axis does not point at the rotor's centre. To first order both effects move the place
// where the field is read, by (1 + tangential) d along the sphere. They scale the field by (|p - d|
// / R)^-decay. field_model.h has decay, and tangential follows from it (TangentialShare).
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "sim/hall/field_model.h"
#include "sim/hall/sensors.h"

namespace focalfleet::sim {

struct HallRig {
  std::vector<HallSensor> sensors = EightSensors();
  SensorElectronics electronics;
  double radius_mm = kSensorRadius_mm;
  Vector3 centre_mm;             // of the rotor from the sensors'. Frame: stator
  double decay = 0;              // B_r ~ r^-decay at the sensors
  double temperature_per_K = 0;  // relative change of the field
  double temperature_reference_C = 20;

  /// The sensor's direction as the rotor's centre sees it, and the factor of its field.
  struct Seen {
    Vector3 direction;
    double factor = 1;
  };
  [[nodiscard]] Seen SeenFromRotor(const HallSensor& sensor) const;
};

/// The degree of the harmonic that is most like an eight-pole field of the paper's width.
inline constexpr double kTypicalDegree = 5.5;
/// The place moves by this share more than d, for a field with this decay. Sources within and
/// without share the field so that their decays add up.
double TangentialShare(double decay);

/// The voltages of all sensors. Shape: as many as sensors; no noise, no clipping.
void PredictVoltages(const HallRig& rig, const FieldModel& field, const Orientation& orientation,
                     std::span<double> voltages_V);

}  // namespace focalfleet::sim
