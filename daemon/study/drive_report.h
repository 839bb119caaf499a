// DriveReport shows a recorded drive as plots. They are those of paper 1's Figs. 12, 13, 15 and 17,
// and two for which its bench had no probe: torque and lag.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "daemon/cli/drive_options.h"
#include "sim/drive/scope/recording.h"

namespace focalfleet::cli {

/// The limits of a phase current by paper 1 and by the circuit. Units: A.
struct CurrentLimits {
  double linear_A = 0;     // V / (sqrt3 r): the largest linear fundamental, paper 1's limit
  double reachable_A = 0;  // 2 V / (3 r): one leg against two, in steady state
};
CurrentLimits LimitsOf(const sim::Drive::Setting& setting);

using TextRows = std::vector<std::vector<std::string>>;

/// The page; `rows` (name, value) stand on top, `settings` at the end.
std::string DriveReport(const DriveChoice& choice, const sim::Recording& recording,
                        const TextRows& rows, const TextRows& settings);

}  // namespace focalfleet::cli
