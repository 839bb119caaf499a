// Calibration finds gain, offset and place of each Hall sensor from known poses in a known field.
// The readings of a sensor then depend on its own four numbers alone. Each sensor is fitted by
// itself, so that no fault of one can hide in another. (hall_diagnosis.h asks for the cause of a
// misfit and leaves the field's amplitude and phase open. Here every number is asked for and the
// field is taken as it stands, so an error of the field goes into gains and places.)
//
// Single readings far from all others are left out. A sensor that does not follow the field is not
// calibrated. Neither is one that no gain, offset and place explain as well as they explain the
// others. Such a sensor keeps its former values and is reported.
#pragma once

#include <vector>

#include "sim/hall/diagnosis/parameters.h"
#include "sim/hall/rig.h"

namespace focalfleet::sim {

/// A reading farther off is no reading of this field. Units: robust standard deviations.
inline constexpr double kFarOff = 6;
/// Cross-validation leaves out one reading in this many at a time.
inline constexpr std::size_t kFolds = 5;

enum class CalibrationStatus {
  kOk,
  kMissing,       // it gives no readings
  kFew,           // too few usable readings
  kStuck,         // it does not follow the field
  kUndetermined,  // the poses do not determine each of its numbers
  kContradicts,   // its residual is several times that of the others
};
/// "ok", "missing", "too few readings", "stuck", "undetermined", "contradicts".
const char* Name(CalibrationStatus status);

struct SensorFit {
  CalibrationStatus status = CalibrationStatus::kMissing;
  HallSensor sensor;  // as calibrated; as given where the status is not ok
  SensorShift shift;  // from the direction given
  double sd_gain = 0, sd_offset_V = 0, sd_east_rad = 0, sd_north_rad = 0;
  std::size_t readings = 0;
  std::size_t missing = 0, saturated = 0, far_off = 0;  // left out
  double rms_before_V = 0;
  double rms_after_V = 0;
  double rms_held_out_V = 0;  // each fifth pose predicted by fits to the others
};

/// A fit for each sensor of `rig`. The rig holds what is known beforehand: directions,
/// electronics, the rotor's centre and temperature. Pre: as many voltages a row as sensors. Cost:
/// some ms for 150 poses.
std::vector<SensorFit> CalibrateSensors(const HallCampaign& campaign, const HallRig& rig,
                                        const FieldModel& field);

}  // namespace focalfleet::sim
