// The state of the fleet as the control socket reports it. docs/cli.md has the members.
#pragma once

#include <string>
#include <vector>

#include "daemon/control/messages.h"
#include "daemon/status/shell_facts.h"
#include "daemon/status/status_snapshot.h"

namespace focalfleet {

/// The current or last configuration, with every unit that was not served.
Json ConfigurationJson(const FleetView& view);
/// The summary of each exposure of a configuration.
Json MeasuredJson(const std::vector<MeasuredRound>& measured);
/// The progress that a waiting client receives. Cost: constant.
Json ProgressJson(const FleetView& view);
Json StatusJson(const FleetView& view, const ShellFacts& facts);
/// The angles of a ball-jointed fibre carrier as its sensors report them.
Json FibreCarrierJson(const FibreCarrierReading& carrier);
Json UnitJson(const FleetView& view, PositionerIndex i);

}  // namespace focalfleet
