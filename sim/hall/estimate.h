// A table of voltages to a table of orientations: which sensors may be trusted, in all rows and in
// each, what noise the residuals show, and of every row an orientation with its uncertainty and a
// word on it.
//
// Sensors that lie. The eight sensors measure three angles, so five numbers a row check each other.
// Hypotheses about all rows are compared by what they leave: nothing wrong; one sensor not to be
// trusted (is it stuck, off in gain or offset?); two sensors swapped. One is named where it leaves
// a quarter or less of the variance and no other comes near; where several do, it is said that they
// cannot be told apart. (A field that is the same above and below the equator does not tell sensors
// 3 and 4 exchanged from 5 and 6 exchanged: the one is the other's mirror image.) A row by itself
// is judged against the noise of the others.
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
  std::vector<std::size_t> sensors;  // from 0; several of kSwapped are the two
  /// Sensors that cannot be told from it; of kSwapped pairs, one after the other.
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
