// The command that an operator will want next, by the state of the fleet.
#pragma once

#include <string>

#include "daemon/status/shell_facts.h"
#include "daemon/status/status_snapshot.h"

namespace focalfleet {

/// A line: a command to type, with the units that it concerns, and in brackets the reason. Faults
/// of the host and of buses come first, then those of units. Cost: one pass over the units.
std::string NextStep(const FleetView& view, const ShellFacts& facts);

}  // namespace focalfleet
