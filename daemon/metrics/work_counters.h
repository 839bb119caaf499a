// Counters of work that is done on the threads of planner, store and camera. Each is written by
// one of these threads and read by any, without a lock.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>

#include "daemon/metrics/histogram.h"

namespace focalfleet {

// Bounds in seconds. A commit waits for one flush of a disk: about 5 ms on flash, 20 ms on a
// spinning one.
inline constexpr std::array<double, 10> kCommitBounds_s = {0.001, 0.002, 0.005, 0.01, 0.02,
                                                           0.05,  0.1,   0.5,   2,    10};
// A plan of 5000 units takes seconds on one core (docs/budgets.md).
inline constexpr std::array<double, 10> kPlannerBounds_s = {0.1, 0.3, 1, 2, 4, 8, 15, 30, 60, 120};

struct WorkCounters {
  std::atomic<std::uint64_t> transactions{0};
  std::atomic<std::uint64_t> rows{0};
  std::atomic<std::uint64_t> transactions_failed{0};
  std::atomic<std::uint64_t> rows_refused{0};
  Histogram commit_s{kCommitBounds_s};
  Histogram planner_s{kPlannerBounds_s};  // one job of any kind
  std::atomic<std::uint64_t> exposures{0};
  std::atomic<std::uint64_t> exposures_failed{0};
  std::atomic<double> exposed_at_s{0};  // Unix seconds of the last usable one; 0: none yet
};

}  // namespace focalfleet
