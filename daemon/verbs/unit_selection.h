// The units that a request chooses: by number, by bus, by state. Conditions that are given must
// hold together.
#pragma once

#include <vector>

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"

namespace focalfleet {

/// The units of {unit_ids?, bus_ids?, states?}, ascending, each once. A state is the name of a
/// phase, `disabled`, or `unknown` for units of unknown place. Errors: kInvalid names the unit, bus
/// or state that does not exist, or says that no condition is given; kRefused: no unit is so.
Result<std::vector<PositionerIndex>> SelectUnits(const Json& args, const FleetView& view);

}  // namespace focalfleet
