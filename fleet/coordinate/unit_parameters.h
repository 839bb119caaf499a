// Parameters of a unit's axes are read in its identification and written by command. A written
// parameter is stored and changes the drive that plans are made with.
#pragma once

#include <cstdint>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/coordination.h"
#include "protocol/base/result.h"

namespace focalfleet {

void OnParameter(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply);
/// The reply to `request` comes when the unit has answered, with the value that holds then.
Status WriteParameter(const Coordination& fleet, std::uint64_t request,
                      const WriteParameterCommand& command);

}  // namespace focalfleet
