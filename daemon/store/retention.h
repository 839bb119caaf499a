// History is kept for so many days. Whether a row is older is not read from the wall clock alone:
// after a step into the future all history would be old. The newest row at the start, and the time
// since by a clock that does not step, bound it.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "daemon/clock/clock.h"
#include "daemon/clock/wall_time.h"
#include "daemon/store/store.h"

namespace focalfleet {

/// Facts by which history is old.
struct HistoryAge {
  WallTime now;                 // by the wall clock
  WallTime newest;              // row of the history when the store was opened; 0: there was none
  double open_s = 0;            // since then, by a clock that does not step
  std::uint32_t keep_days = 0;  // 0: all history stays
};
/// History from before is old.
WallTime OldBefore(const HistoryAge& age);

struct Retention {
  std::uint32_t keep_days = 0;  // 0: all history stays
  std::function<std::int64_t()> monotonic_ns = &ReadMonotonicNs;
  std::function<WallTime()> wall = &WallTime::Now;
};
/// A function for StoreThread::Sinks::upkeep that prunes a piece of the old history and returns
/// whether there is more. Where a piece stays because the store fails, it calls `failed` with the
/// reason. `store` outlives it. Errors: as Store::Newest.
Result<std::function<bool()>> PruningOf(Store* store, Retention retention,
                                        std::function<void(const std::string&)> failed);

}  // namespace focalfleet
