// What must not be lost, in one SQLite file. A batch of rows is one transaction: WAL with
// synchronous=FULL, so that a batch which Commit acknowledged is there after kill -9 and after a
// power cut, and one which it did not is there wholly or not at all. 10,000 axes a commit cost
// about what a bare sqlite3 loop does (tests/bench/store_bench.cc).
//
// One process writes: it holds a lock on `<path>.lock` for as long as it lives. Any number may read
// beside it through StoreReader (WAL readers do not hold up the writer), each on a connection of
// its own, so the shell can answer `history` on one thread while another commits.
//
// The file is outside our reasoning: every value that comes back is checked before it becomes a
// type of ours, and a bad one is an error that names table and row. docs/adr/0005-store.md has the
// tables.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

namespace store_internal {
class Connection;
class LockFile;
struct Statements;
}  // namespace store_internal

struct StoreOptions {
  std::chrono::milliseconds busy_wait{2000};  // for a reader that holds the file for a moment
  const char* vfs = nullptr;                  // SQLite's file layer; tests put a failing one in
};

struct StoreCounters {
  std::uint64_t transactions = 0;
  std::uint64_t rows = 0;
  std::uint64_t failed = 0;  // transactions that were rolled back
};

/// The writer.
class Store {
 public:
  /// The store at `path` exists, is ours alone and has the present schema; the file is made where
  /// there is none, and an older schema is carried over, one transaction a step. Errors: kRefused:
  /// another process has it open (named by pid). kNewer: written by a later version; nothing was
  /// touched. kInvalid: the file is something else. kUnavailable, kFull: it cannot be opened or
  /// written.
  static Result<std::unique_ptr<Store>> Open(const std::string& path,
                                             const StoreOptions& options = {});
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;
  ~Store();

  /// All that the coordinator needs to go on. Errors: kInvalid names table, row and value.
  Result<StoredFleet> Load();

  /// `rows` are durable, all of them, in order; but ends of intents are written last, with the
  /// place at which the batch leaves the unit. A batch that failed may be offered again.
  /// Errors: kFull: no space; kUnavailable: the disk or file fails; kInvalid: a row could not be
  /// read back (fleet/row_check.h) or contradicts what is stored; `refused`, where it is given, is
  /// then the index of that row, else rows.size(). Nothing of the batch was written then, and a
  /// later Commit may succeed.
  /// Cost: one prepared statement a row (two for a VectorRow), no allocation, one fsync.
  Status Commit(std::span<const Row> rows, WallTime now, std::size_t* refused = nullptr);

  /// Ended moves, configurations and alarms that are older are gone; at most `rows_max` of each
  /// table, so that the transaction stays short. What the coordinator loads is never pruned.
  Result<std::uint64_t> Prune(WallTime before, std::uint32_t rows_max);

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
  StoreCounters counters_;
};

/// One motion of one unit, from the intent to its end. Units: vectors.
struct MoveHistory {
  std::uint64_t configuration = 0;
  UnitId unit;
  SerialNumber serial;
  MoveId move;
  Pose from{};
  Pose to{};
  UnitKnowledge hull;
  WallTime began;
  std::optional<WallTime> ended;          // none: the intent is open
  std::optional<IntentEnd> end;           // present with `ended`
  std::optional<UnitKnowledge> ended_at;  // what was known of the unit then
};

struct ConfigurationHistory {
  ConfigurationRow row;
  WallTime began;
  WallTime changed;  // last written: the end, where the state is done, stopped or failed
};

struct ParameterHistory {
  ParameterRow row;
  WallTime at;
};

struct TuningHistory {
  TuningRow row;
  WallTime at;
};

struct AlarmHistory {
  AlarmRow row;
  WallTime at;
};

/// What happened to a place: bound to a serial number, disabled, enabled.
struct UnitHistory {
  UnitId unit;
  SerialNumber serial;
  bool enabled = true;
  std::string reason;
  WallTime at;
};

struct MeasurementHistory {
  MeasurementRow row;
  WallTime at;  // stored
  /// The unit was sent again after this exposure, in the same configuration: it is elsewhere now.
  bool moved_since = false;
};

struct ModelHistory {
  ModelRow row;  // without its text
  WallTime at;
};

/// A reader beside the writer, in any process. Each query sees one whole state. Lists are newest
/// first. Errors of all queries: kInvalid names table and row; kUnavailable: the file cannot be
/// read.
class StoreReader {
 public:
  /// Errors: kUnavailable: no such file, or not readable; kNewer; kInvalid: not a store.
  static Result<std::unique_ptr<StoreReader>> Open(const std::string& path,
                                                   const StoreOptions& options = {});
  StoreReader(const StoreReader&) = delete;
  StoreReader& operator=(const StoreReader&) = delete;
  ~StoreReader();

  Result<StoredFleet> Load();
  Result<std::vector<MoveHistory>> Moves(std::optional<UnitId> unit, std::uint32_t limit);
  Result<std::vector<ConfigurationHistory>> Configurations(std::uint32_t limit);
  Result<std::vector<ParameterHistory>> Parameters(SerialNumber serial, std::uint32_t limit);
  Result<std::vector<TuningHistory>> Tunings(SerialNumber serial, std::uint32_t limit);
  Result<std::vector<AlarmHistory>> Alarms(std::uint32_t limit);
  /// Of one exposure, by unit id.
  Result<std::vector<MeasurementHistory>> Measurements(std::uint64_t exposure);
  /// The newest exposure of a configuration; none: it was never measured.
  Result<std::optional<std::uint64_t>> LastExposure(std::uint64_t configuration);
  Result<std::vector<ModelHistory>> Models(std::uint32_t limit);
  /// Units whose count began anew later than that: homed, set by hand, found by the camera, or
  /// other hardware was adopted there.
  Result<std::vector<UnitId>> CountedAnewSince(WallTime since);
  /// Which hardware is bound to which place.
  Result<std::vector<std::pair<UnitId, SerialNumber>>> Bindings();
  /// Errors: kRefused: there is none of that sha256.
  Result<std::string> ModelText(const std::string& sha256);
  Result<std::vector<UnitHistory>> Units(std::optional<UnitId> unit, std::uint32_t limit);

 private:
  StoreReader();

  std::unique_ptr<store_internal::Connection> connection_;
};

}  // namespace focalfleet
