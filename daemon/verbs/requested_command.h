// The command that a request asks of the coordinator. The arguments are read and checked against
// the fleet in its present state, before anything happens.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// The unit of the argument `unit_id`. Errors: kInvalid where there is no such unit.
Result<PositionerIndex> UnitArgument(const Json& args, const Layout& layout);

/// A request that changes something, as the coordinator's command. Verbs: apply retarget stop home
/// measure disable enable adopt params_set. Errors: kInvalid or kRefused, with a text for people;
/// nothing has happened then.
Result<Command> CommandOf(const ControlRequest& request, const FleetView& view);

}  // namespace focalfleet
