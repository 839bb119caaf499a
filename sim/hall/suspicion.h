// The sensors that are faulty in all rows of a table; estimate.h describes the decision.
#pragma once

#include "sim/hall/estimate.h"

namespace focalfleet::sim {

/// Faulty sensors are taken out of the readings, swapped ones are exchanged in them.
std::vector<SensorVerdict> SuspectSensors(const OrientationSolver& solver,
                                          const std::vector<VoltageRow>& rows,
                                          std::vector<HallReading>* readings, double usual_noise_T);

}  // namespace focalfleet::sim
