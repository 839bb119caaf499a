// Parameters of a unit's axes are read in its identification and written by command. A written
// parameter is stored and changes the drive that plans are made with.
#pragma once

#include <cstdint>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/coordination.h"
#include "protocol/base/result.h"

namespace focalfleet {

void OnParameter(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply);
/// Asks the unit to take the value, after its open question and parameters that wait already, or
/// when it has been read. The reply to `request` comes when the unit has answered, with the value
/// that holds then. Errors: kRefused: the unit does not rest; kFull.
Status WriteParameter(const Coordination& fleet, std::uint64_t request,
                      const WriteParameterCommand& command);
/// Writes the parameter that has waited longest. Pre: one waits, no question is open, and the unit
/// is not being read.
void WriteNext(const Coordination& fleet, PositionerIndex i);

}  // namespace focalfleet
