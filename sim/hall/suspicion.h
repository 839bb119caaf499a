// The sensors that are faulty in all rows of a table; estimate.h describes the decision.
#pragma once

#include "sim/hall/estimate.h"

namespace focalfleet::sim {

/// A sensor whose readings differ by less stands still. Units: V.
inline constexpr double kAlike_V = 2e-3;

/// Faulty sensors are taken out of the readings, swapped ones are exchanged in them.
std::vector<SensorVerdict> SuspectSensors(const OrientationSolver& solver,
                                          const std::vector<VoltageRow>& rows,
                                          std::vector<HallReading>* readings, double usual_noise_T);

}  // namespace focalfleet::sim
