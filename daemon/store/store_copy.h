// Copies of a store's file, as backup and back. The store may be in use meanwhile: a copy holds all
// batches up to one instant. A copy of the file alone, without its write-ahead log, would not.
#pragma once

#include <string>

#include "daemon/store/store_health.h"
#include "daemon/store/store_options.h"
#include "protocol/base/result.h"

namespace focalfleet {

/// The file can be read by the daemon: pages and all rows that the daemon loads are checked, with
/// their checksums. Errors: kInvalid: the first fault, by table and row, or nothing is in it; else
/// as InspectHealth.
Result<StoreHealth> CheckStore(const std::string& path, const StoreOptions& options = {});

/// `to` is a durable copy of the store `from`, checked as CheckStore does, complete or not there.
/// Errors: kRefused: `to` exists; kFull, kUnavailable; kInvalid: `from` is no sound store.
Status BackUpStore(const std::string& from, const std::string& to,
                   const StoreOptions& options = {});

/// `store` is a store again, as `backup` was. Numbers of moves go on far from those that the backup
/// gave out, because units may hold moves of the time since. The file and its lock have the rights
/// of their folder, and as root its owner and group. Errors: as BackUpStore; kRefused: `store` or
/// its write-ahead log exists, or a daemon has it.
Status RestoreStore(const std::string& backup, const std::string& store,
                    const StoreOptions& options = {});

}  // namespace focalfleet
