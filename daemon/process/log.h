// The daemon's log goes by spdlog to standard error or a file, one sentence an event. Any thread
// may write. An event is one line of the log whatever its text holds (control/printable.h).
#pragma once

#include <string>

#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The log goes from now on to the destination that `log` names. Errors: kUnavailable: the file
/// cannot be opened.
Status OpenLog(const DaemonConfig::Log& log);

}  // namespace focalfleet
