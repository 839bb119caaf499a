// The daemon's log: one sentence an event, by spdlog, to standard error or a file. Any thread may
// write. An event is one line of the log whatever its text holds (control/printable.h).
#pragma once

#include <string>

#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// From now on the log goes where `log` says. Errors: kUnavailable: the file cannot be opened.
Status OpenLog(const DaemonConfig::Log& log);

}  // namespace focalfleet
