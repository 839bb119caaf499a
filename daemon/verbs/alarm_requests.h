// The requests about alarms: what is open, what was open, and what operators do about it.
#pragma once

#include <optional>
#include <string>

#include "daemon/control/messages.h"
#include "daemon/verbs/alarm_register.h"
#include "daemon/verbs/history_requests.h"
#include "fleet/coordinate/commands.h"

namespace focalfleet {

/// The answer to `alarms`. Arguments: {all?, since_ns?, severity?, limit?}. With `all`, alarms that
/// are over come from the store; without it the store is not read, and may be null. Errors:
/// kInvalid names the argument; those of the store.
Result<StoreReading> AskAlarms(const ControlRequest& request, const AlarmRegister& alarms,
                               WallTime now);

/// The command that keeps what an operator does about alarms; none: the verb is another one.
/// Verbs: alarms_ack {ids?, names?}, alarms_mute {name, for_s, reason}, alarms_unmute {name}. `by`
/// names the operator. The register has changed already. Errors: kInvalid, kRefused.
std::optional<Result<Command>> ChangeAlarms(const ControlRequest& request, AlarmRegister* alarms,
                                            const std::string& by, WallTime now);

}  // namespace focalfleet
