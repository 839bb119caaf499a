// Old history goes in pieces: each looks at a few rows of one table after the other, and the next
// one goes on where it stopped. Rows that stay are thereby looked at once a round.
#pragma once

#include <cstdint>

#include "daemon/clock/wall_time.h"
#include "daemon/store/history.h"
#include "daemon/store/sqlite.h"
#include "protocol/base/result.h"

namespace focalfleet::store_internal {

class Pruner {
 public:
  /// Looks at `rows_max` rows, and deletes those of them that are old, in the transaction that is
  /// open. Adds SQLite's instructions to `instructions`. Errors: those of SQLite; call Restart.
  Result<Pruned> Step(Connection& connection, WallTime before, std::uint32_t rows_max,
                      std::uint64_t* instructions);
  /// The next step begins a round.
  void Restart() { *this = {}; }

 private:
  std::size_t table_ = 0;
  std::int64_t after_[2] = {INT64_MIN, INT64_MIN};  // key of the last row that was looked at
};

}  // namespace focalfleet::store_internal
