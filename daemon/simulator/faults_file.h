// faults.csv lists the faults of buses and units of the simulated fleet: kind, start, end and
// probability. docs/files.md describes it; deploy/faults.csv is an example.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "sim/world/fault_plan.h"
#include "sim/world/unit_description.h"

namespace focalfleet::simulator {

struct FaultsFor {
  const std::vector<sim::UnitDescription>& units;  // that the file may name, and their buses
  bool bit_clock = true;  // false: real interfaces carry the frames, and have their own faults
};

/// A fault for each bus or unit that a row names, in the order of the file. Total: any bytes give a
/// plan or an Error.
/// Errors: kInvalid, with file, line, column and reason.
Result<std::vector<sim::PlannedFault>> ReadFaults(std::string_view text, std::string file,
                                                  const FaultsFor& fleet);

}  // namespace focalfleet::simulator
