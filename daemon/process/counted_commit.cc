#include "daemon/process/counted_commit.h"

#include <chrono>

namespace focalfleet {

Status CommitCounted(std::span<const Row> rows, WallTime at, std::size_t* refused, Store* store,
                     WorkCounters* work) {
  const auto begun = std::chrono::steady_clock::now();
  Status done = store->Commit(rows, at, refused);
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begun;
  work->commit_s.Observe(taken.count());
  work->transactions = store->counters().transactions;
  work->rows = store->counters().rows;
  work->transactions_failed = store->counters().failed;
  if (!done && done.error().code == ErrorCode::kInvalid && *refused < rows.size())
    ++work->rows_refused;
  return done;
}

}  // namespace focalfleet
