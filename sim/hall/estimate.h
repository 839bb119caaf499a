// A table of voltages becomes a table of orientations. The estimate finds the sensors that can be
// trusted, in all rows and in each, and the noise of the residuals. Every row gets an orientation
// with its uncertainty and a status.
//
// Faulty sensors. The eight sensors measure three angles, so five numbers a row check each other.
// Hypotheses about all rows are compared by the variance that they leave. They are: no fault; one
// sensor not to be trusted (stuck, or off in gain or offset); two sensors swapped. A hypothesis is
// named where it leaves a quarter or less of the variance and no other comes near. Where several
// do, the report says that they cannot be distinguished. (In a field that is the same above and
// below the equator an exchange of sensors 3 and 4 looks like one of 5 and 6. They are mirror
// images.) A single row is judged against the noise of the others.
//
// Statuses: `ok`; `saturated v3`, `missing v3`, `stuck v3`, `bad v3`, `swapped v3 v4` (the
// orientation comes from the others, or with the two exchanged); `ambiguous` (another orientation
// explains the voltages as well within 3 standard deviations); `cannot tell` (voltages that
// contradict each other, and no sensor to blame); `too few sensors`. Several are joined by "; ".
#pragma once

#include <string>
#include <vector>

#include "sim/hall/orient.h"

namespace focalfleet::sim {

struct VoltageRow {
  std::vector<double> voltages_V;  // NaN: missing
  double temperature_C = std::numeric_limits<double>::quiet_NaN();
};

enum class SensorFault { kMissing, kStuck, kSwapped, kGain, kOffset, kBad };
std::string_view Name(SensorFault fault);

struct SensorVerdict {
  SensorFault fault = SensorFault::kBad;
  std::vector<std::size_t> sensors;  // from 0; kSwapped has its two sensors here
  /// The sensors that cannot be distinguished from it. For kSwapped: pairs, one after the other.
  std::vector<std::size_t> or_else;
  double variance_left = 0;  // over that without the hypothesis
};

struct RowEstimate {
  bool solved = false;
  Orientation orientation;
  std::array<double, 3> sd_rad{};  // alpha, beta, gamma
  std::size_t branches = 1;        // orientations that explain the row as well
  std::string status;
};

struct Estimates {
  std::vector<RowEstimate> rows;
  std::vector<SensorVerdict> verdicts;
  double noise_T = 0;  // a sensor, as the covariances use it
  bool noise_from_residuals = false;
  bool beyond_supply = false;  // voltages outside 0..supply: nothing was clipped
};

struct EstimateOptions {
  bool magnitudes = false;  // voltages are |V - Vs/2|
  double tilt_max_rad = 45 * kRadPerDeg;
  double noise_T = 0;  // 0: from the residuals, or 0.5 mT where there are few rows
};

/// Cost: about 0.3 ms a row, and half a second for the hypotheses.
Estimates EstimateOrientations(HallRig rig, const std::shared_ptr<const FieldModel>& field,
                               const std::vector<VoltageRow>& rows, const EstimateOptions& options);

}  // namespace focalfleet::sim
