// Which sensors lie in all rows of a table; estimate.h says how it is decided.
#pragma once

#include "sim/hall/estimate.h"

namespace focalfleet::sim {

/// Sensors that are found out are taken out of the readings, swapped ones exchanged in them.
std::vector<SensorVerdict> SuspectSensors(const OrientationSolver& solver,
                                          const std::vector<VoltageRow>& rows,
                                          std::vector<HallReading>* readings, double usual_noise_T);

}  // namespace focalfleet::sim
