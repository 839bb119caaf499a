// A commit of the store, with the counts that the metrics show.
#pragma once

#include <cstddef>
#include <span>

#include "daemon/metrics/work_counters.h"
#include "daemon/store/store.h"

namespace focalfleet {

/// Store::Commit; its time and outcome are counted in `work`.
Status CommitCounted(std::span<const Row> rows, WallTime at, std::size_t* refused, Store* store,
                     WorkCounters* work);

}  // namespace focalfleet
