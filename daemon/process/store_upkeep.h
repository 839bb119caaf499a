// The upkeep of the daemon's store, on the store's thread.
#pragma once

#include <cstdint>
#include <functional>

#include "daemon/store/store.h"

namespace focalfleet {

/// A function that prunes a piece of the history older than `keep_days` (0: none), for
/// StoreThread::Sinks::upkeep. `store` outlives it. Errors: as Store::Newest.
Result<std::function<bool()>> PruningOf(Store* store, std::uint32_t keep_days);

}  // namespace focalfleet
