// These functions read and write the tables of a Hall rig as CSV: field maps, sensors, voltages and
// poses in; orientations out. The page docs/hall.md has the columns. Angles are degrees in files
// and radians here.
#pragma once

#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/hall/diagnosis/calibration.h"
#include "sim/hall/estimate.h"
#include "sim/hall/field_fit.h"

namespace focalfleet {

/// Reads theta_deg, phi_deg, b_T and, where it differs from 59, r_mm.
/// Errors: kInvalid with file:line and column: missing, not finite, theta outside 0..180, more than
/// 10 T.
Result<sim::FieldMap> ReadFieldMap(std::string_view text, std::string file);

/// Reads sensor, x, y, z: unit directions from the centre, stator frame, sensors 1..n in any order.
/// Also gain (default 1) and offset_V (default 0) where the columns are there. Other columns are
/// ignored.
/// Errors: kInvalid with file:line and column: a number twice or left out, no unit vector, a gain
/// of 0 or beyond +-100, an offset beyond +-100 V, more than kSensorsMax.
Result<std::vector<sim::HallSensor>> ReadSensors(std::string_view text, std::string file);

/// Reads v1_V ... vn_V, and temp_C where it is there; an empty voltage is a missing one.
/// Errors: kInvalid with file:line and column: a column missing, no number, beyond +-1000 V.
Result<std::vector<sim::VoltageRow>> ReadVoltages(std::string_view text, std::string file,
                                                  std::size_t sensors);

/// Writes sensor, x, y, z, gain, offset_V as ReadSensors reads them. Then come sd_gain,
/// sd_offset_V, sd_east_deg, sd_north_deg (missing where a sensor was not calibrated), readings,
/// rms_V, status.
std::string WriteCalibration(const std::vector<sim::SensorFit>& sensors);

struct PoseTable {
  std::vector<sim::Orientation> poses;
  std::vector<sim::VoltageRow> rows;
  bool has_temperature = false;
  std::vector<std::string> passed_over;  // columns that are not read
};
/// Reads alpha_deg, beta_deg, gamma_deg, v1_V ... vn_V, and temp_C where it is there.
/// Errors: as ReadVoltages; a pose must be there.
Result<PoseTable> ReadPoses(std::string_view text, std::string file, std::size_t sensors);

/// Writes alpha_deg, beta_deg, gamma_deg, sd_alpha_deg, sd_beta_deg, sd_gamma_deg, status: one row
/// for each row of voltages. A row without an orientation has no numbers.
std::string WriteEstimates(const sim::Estimates& estimates);

}  // namespace focalfleet
