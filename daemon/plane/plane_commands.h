// The command that a request asks of a plane's coordinator: apply, home, measure, retarget, stop.
// The arguments are those of a daemon of its own (verbs/requested_command.h). They are checked
// against places and drives of all units as their sectors last reported them, before anything
// happens.
#pragma once

#include <string>

#include "daemon/control/messages.h"
#include "daemon/plane/plane_requests.h"
#include "fleet/plane/plane_coordinator.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// Whether PlaneCommandOf knows the verb.
bool IsPlaneCommand(const std::string& verb);

/// Pre: IsPlaneCommand; `plane` has a table. Errors: kInvalid or kRefused, with a text for people;
/// nothing has happened then.
Result<PlaneCommand> PlaneCommandOf(const PlaneInstant& plane, const ControlRequest& request);

/// Nothing changes. Pre: as above. Errors: those of `apply`.
Result<PlanePreview> PlanePreviewOf(const PlaneInstant& plane, const Json& args);

}  // namespace focalfleet
