// HallModelFile is model.toml of a Hall rig. The file holds the fitted field and what is known of
// the rig: gains, offsets, sensor positions, the rotor's centre and temperature. Each has its
// uncertainty where it has one.
//
// `hall fit` writes the field, `hall diagnose` writes both. `hall orient` and `hall diagnose
// --model` read them.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/hall/field_model.h"
#include "sim/hall/rig.h"

namespace focalfleet {

/// The deviation of one sensor that a campaign found, relative to what is known of it otherwise.
struct SensorCalibration {
  std::size_t sensor = 0;  // from 0
  double gain = 1;
  double offset_V = 0;
  double shift_east_rad = 0;   // along growing longitude
  double shift_north_rad = 0;  // towards +Z
};

struct HallModelFile {
  std::string name;
  std::string origin;  // name of the file that it was made from
  std::string sha256;
  sim::FieldParameters field;
  double radius_mm = sim::kSensorRadius_mm;
  double peak_T = 0;
  double rms_T = 0;
  double noise_T = 0;
  double decay = 0;
  bool decay_known = false;
  std::vector<SensorCalibration> sensors;
  sim::Vector3 centre_mm;
  double temperature_per_K = 0;
  double temperature_reference_C = 20;
  std::vector<std::string> notes;  // comments at its head
};

std::string WriteHallModel(const HallModelFile& model);

/// The model in `text`.
/// Errors: kInvalid with file and line: not TOML, a key missing, unknown or out of its range.
Result<HallModelFile> ReadHallModel(std::string_view text, const std::string& file);

/// The sensors with the model's calibration applied to theirs: gains multiply, offsets and shifts
/// add up.
/// Errors: kInvalid: the model has a sensor that is not in `sensors`.
Result<sim::HallRig> RigOf(const HallModelFile& model, std::vector<sim::HallSensor> sensors);

}  // namespace focalfleet
