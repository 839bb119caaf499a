// The daemon's log goes by spdlog to standard error, to a file, or with fields to the journal, one
// sentence an event. Any thread may write. An event is one line of the log whatever its text holds
// (control/printable.h).
#pragma once

#include <string>

#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The journal as this process finds it.
struct JournalPlace {
  bool takes_standard_error = false;
  std::string socket;
};
JournalPlace JournalOfThisProcess();

/// The log goes from now on to the destination that `log` names. Without a file, and where the
/// journal takes standard error anyway, events go to its socket with their fields. An event that
/// the journal does not take goes to standard error. Errors: kUnavailable: the file cannot be
/// opened.
Status OpenLog(const DaemonConfig::Log& log, const JournalPlace& journal);

/// The log's file is opened anew by its name, as after a rename by logrotate; any other
/// destination stays as it is. A file that cannot be opened is reported in the one used so far.
void ReopenLog();

}  // namespace focalfleet
