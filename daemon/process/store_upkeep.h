// The upkeep of the daemon's store, on the store's thread.
#pragma once

#include <cstdint>
#include <functional>

#include "daemon/store/store.h"

namespace focalfleet {

/// A function for StoreThread::Sinks::upkeep: it tells the head of the audit, where that is another
/// one than the last, and prunes as PruningOf does. `store` outlives it. Errors: as PruningOf.
Result<std::function<bool()>> UpkeepOf(Store* store, std::uint32_t keep_days);

/// A function that prunes a piece of the history older than `keep_days` (0: none), for
/// StoreThread::Sinks::upkeep. `store` outlives it. Errors: as Store::Newest.
Result<std::function<bool()>> PruningOf(Store* store, std::uint32_t keep_days);

}  // namespace focalfleet
