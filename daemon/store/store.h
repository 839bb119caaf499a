// The store keeps all that must not be lost, in one SQLite file. A batch of rows is one
// transaction, in a WAL with synchronous=FULL. A batch that Commit acknowledged survives kill -9
// and a power cut; any other batch is there wholly or not at all. A commit of 10,000 axes costs
// about what a bare sqlite3 loop costs (tests/bench/store_bench.cc).
//
// A single process writes: it holds a lock on `<path>.lock` for as long as it lives. Any number may
// read beside it through StoreReader, each on a connection of its own: readers of a WAL do not hold
// up the writer. Thereby the daemon can answer `history` on one thread while another commits.
//
// The file may hold anything: every value that is read is checked before it becomes a type of this
// project. A bad value is an error that names table and row. docs/adr/0005-store.md has the tables.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "daemon/clock/wall_time.h"
#include "daemon/store/audit_chain.h"
#include "daemon/store/history.h"
#include "daemon/store/store_options.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

namespace store_internal {
class Connection;
class LockFile;
class Pruner;
class Statements;
}  // namespace store_internal

struct StoreCounters {
  std::uint64_t transactions = 0;
  std::uint64_t rows = 0;
  std::uint64_t failed = 0;              // transactions that were rolled back
  std::uint64_t prune_instructions = 0;  // of SQLite
};

/// The writer of a store.
class Store {
 public:
  /// The store at `path` exists, is locked for this process and has the present schema. A missing
  /// file is made, and an older schema is carried over, one transaction a step.
  /// Errors: kRefused: another process has it open (named by pid). kNewer: written by a later
  /// version; nothing was touched. kInvalid: the file is something else. kUnavailable, kFull: the
  /// file cannot be opened or written.
  static Result<std::unique_ptr<Store>> Open(const std::string& path,
                                             const StoreOptions& options = {});
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  ~Store();

  /// All that the coordinator needs to go on. Errors: kInvalid names table, row and value.
  Result<StoredFleet> Load();

  /// All `rows` are durable, written in order. Ends of intents are written last, with the place at
  /// which the batch leaves the unit. A batch that failed may be offered again.
  /// Errors: kFull: no space; kUnavailable: the disk or file fails; kInvalid: a row could not be
  /// read back (fleet/row_check.h) or contradicts what is stored. `refused`, where it is given, is
  /// then the index of that row, else rows.size(). After an error nothing of the batch is written,
  /// and a later Commit may succeed.
  /// Cost: one prepared statement a row (two for a VectorRow), no allocation, one fsync.
  Status Commit(std::span<const Row> rows, WallTime now, std::size_t* refused = nullptr);

  /// The time of the newest row of the history; 0: there is none.
  Result<WallTime> Newest();

  /// The last entry of the audit; number 0: there is none.
  Result<AuditHead> LastAudit();

  /// A piece of all history is rid of what is from before `before`: ended moves, configurations,
  /// measurements, orientations, alarms, histories of units, axes, parameters and tunings.
  /// `rows_max` rows are looked at, so that the transaction stays short. The next call goes on
  /// where this one stopped. Rows that a start of the daemon reads stay: what the coordinator
  /// loads, and what says for which units a model holds. The newest history of each unit, and of
  /// parameters and tunings in force, stays, as do texts of models.
  Result<Pruned> Prune(WallTime before, std::uint32_t rows_max);

  [[nodiscard]] const StoreCounters& counters() const { return counters_; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  Store();
  Status Reject(Error why);
  Status Rollback(Error why);

  std::string path_;
  std::unique_ptr<store_internal::LockFile> lock_;
  std::unique_ptr<store_internal::Connection> connection_;
  std::unique_ptr<store_internal::Statements> statements_;
  std::unique_ptr<store_internal::Pruner> pruner_;
  StoreCounters counters_;
};

}  // namespace focalfleet
