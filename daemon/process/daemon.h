// focalfleetd put together: files, store, buses, threads, in the order in which each may refuse to
// start, so that whatever is wrong is said before anything is touched.
#pragma once

#include "daemon/process/config.h"
#include "protocol/base/result.h"

namespace focalfleet {

const char* Version();

struct DaemonEnd {
  Status status;
  /// A thread did not end in time and still runs, so the process has to end by _exit.
  bool left = false;
};

/// Runs until SIGTERM or SIGINT. Errors: why it could not start (kRefused: another daemon holds the
/// store or the socket), or that rows could not be stored at the end.
DaemonEnd RunDaemon(const DaemonConfig& config);

/// `--check`: the configuration and its files are good. The effective configuration, for people and
/// programs.
Result<std::string> CheckDaemon(const DaemonConfig& config);

}  // namespace focalfleet
