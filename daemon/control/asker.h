// Whom a request is for. Other doors of a daemon ask over its control socket on behalf of the
// bearers of tokens; nobody else may name another caller.
#pragma once

#include <cstdint>

#include "daemon/control/line_exchange.h"
#include "daemon/control/messages.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The caller whose role counts. `own_pid`: clients of this process may ask on behalf of others.
/// Errors: kRefused: somebody else names another caller.
inline Result<Caller> AskerOf(const ControlRequest& request, const IncomingLine& line,
                              std::uint32_t own_pid) {
  if (!request.caller) return line.caller;
  if (line.caller.peer && line.caller.peer->pid == own_pid) return *request.caller;
  return Fail(ErrorCode::kRefused, "only the daemon itself asks on behalf of others");
}

}  // namespace focalfleet
