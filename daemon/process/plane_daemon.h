// focalfleetd as the coordinator of a plane: its record, its control socket, its link to the
// sectors, and a thread that plans. Buses and units are the sectors'.
#pragma once

#include "daemon/process/config.h"
#include "fleet/plane/plane_layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The plane as the configuration has it. Pre: [plane] has sectors. Errors: kInvalid,
/// kUnavailable: a file, or buses that are in no sector or in two.
Result<PlaneLayout> LoadPlane(const DaemonConfig& config);

/// The coordinator ran until SIGTERM or SIGINT. Errors: why it could not start.
Status RunPlane(const DaemonConfig& config);

}  // namespace focalfleet
