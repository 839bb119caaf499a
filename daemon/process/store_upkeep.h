// The upkeep of the daemon's store, on the store's thread.
#pragma once

#include <cstdint>
#include <functional>

#include "daemon/store/store.h"

namespace focalfleet {

/// A function for StoreThread::Sinks::upkeep: it logs the head of the audit and hands it to
/// `report`, where that is another one than the last, and prunes history older than `keep_days` (0:
/// none). A head that `report` does not take (false) is handed over the next time. `store` outlives
/// it. Errors: as PruningOf.
Result<std::function<bool()>> UpkeepOf(Store* store, std::uint32_t keep_days,
                                       std::function<bool(const AuditHead&)> report);

}  // namespace focalfleet
