// A plane's coordinator refuses the requests that it does not carry out itself, and names the place
// to ask: the host and the control socket of each daemon that has the units.
#pragma once

#include "daemon/control/messages.h"
#include "daemon/plane/plane_requests.h"

namespace focalfleet {

/// Why the request is not for the coordinator, and whom to ask. The units are those of `unit_id` or
/// `unit_ids`; without these all sectors are meant.
Error RefusalOf(const PlaneInstant& plane, const ControlRequest& request);

}  // namespace focalfleet
