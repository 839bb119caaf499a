// A kernel that could not write a page at a sync takes it for clean, and goes on reading it from
// memory (Rebello et al., "Can Applications Recover from fsync Failures?", USENIX ATC 2020). A
// process that starts after such a failure finds batches in the write-ahead log that were never
// acknowledged and are not on the disk. Batches that it adds behind them would be lost with them in
// a power cut. The log that an earlier process left is therefore written once more, in its place
// and to the byte, before anything is added.
#pragma once

#include "daemon/store/sqlite.h"

namespace focalfleet::store_internal {

/// The write-ahead log is on the disk as it reads. Pre: the connection has read. Errors: as CodeOf.
/// Cost: one pass over the log, 4 MB as a rule.
Status RewriteLog(Connection& connection);

}  // namespace focalfleet::store_internal
