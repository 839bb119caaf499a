// The daemon put together: files, store, buses, threads. Parts that may refuse to start come first,
// so that a fault is reported before anything is touched.
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

/// The daemon ran until SIGTERM or SIGINT. Errors: the reason why it could not start (kRefused:
/// another daemon holds the store or the socket), or that rows could not be stored at the end.
DaemonEnd RunDaemon(const DaemonConfig& config);

/// `--check`: the configuration and its files are good. The result is the effective configuration,
/// as TOML.
Result<std::string> CheckDaemon(const DaemonConfig& config);

}  // namespace focalfleet
