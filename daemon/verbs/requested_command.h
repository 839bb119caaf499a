// What a request asks the coordinator to do: its arguments read and checked against the fleet as it
// stands, before anything happens.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/status/status_snapshot.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// The unit of the argument `unit_id`. Errors: kInvalid where there is none such.
Result<PositionerIndex> UnitArgument(const Json& args, const Layout& layout);

/// A request that changes something, as the coordinator's command. Verbs: apply retarget stop home
/// disable enable adopt params_set. Errors: kInvalid or kRefused for people; nothing has happened
/// then.
Result<Command> CommandOf(const ControlRequest& request, const FleetView& view);

}  // namespace focalfleet
