// Gain, offset and place of each Hall sensor from poses that are known, where the field is known,
// too. Every sensor's readings then depend on its own four numbers alone, so each is fitted by
// itself: nothing of one sensor can hide in another. (hall_diagnosis.h asks which cause there is
// and leaves the field's amplitude and phase open; here every number is asked for and the field is
// taken as it stands, so a field that errs goes into gains and places.)
//
// Single readings far from all others are left out. A sensor that does not follow the field, or
// that no gain, offset and place explains as well as they explain the others, is not calibrated:
// it keeps what it had and is said.
#pragma once

#include <vector>

#include "sim/hall/diagnosis/parameters.h"
#include "sim/hall/rig.h"

namespace focalfleet::sim {

enum class CalibrationStatus {
  kOk,
  kMissing,       // it says nothing
  kFew,           // readings that can be used
  kStuck,         // it does not follow the field
  kUndetermined,  // the poses do not tell its numbers apart
  kContradicts,   // left over is several times what the others leave
};
/// "ok", "missing", "too few readings", "stuck", "undetermined", "contradicts".
const char* Name(CalibrationStatus status);

struct SensorFit {
  CalibrationStatus status = CalibrationStatus::kMissing;
  HallSensor sensor;  // as calibrated; as given where it is not ok
  SensorShift shift;  // from the direction given
  double sd_gain = 0, sd_offset_V = 0, sd_east_rad = 0, sd_north_rad = 0;
  std::size_t readings = 0;
  std::size_t missing = 0, saturated = 0, far_off = 0;  // left out
  double rms_before_V = 0;
  double rms_after_V = 0;
  double rms_held_out_V = 0;  // each fifth pose predicted by fits to the others
};

/// One for each sensor of `rig`, which is what is known beforehand: directions, electronics, the
/// rotor's centre and temperature. Pre: as many voltages a row as sensors.
/// Cost: some ms for 150 poses.
std::vector<SensorFit> CalibrateSensors(const HallCampaign& campaign, const HallRig& rig,
                                        const FieldModel& field);

}  // namespace focalfleet::sim
