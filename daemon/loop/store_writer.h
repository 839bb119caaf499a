// The writer of the store. Batches of rows are committed in order, and none is dropped. A batch
// that cannot be written now is tried again each second, and all later ones wait. A row that can
// never be written (fleet/row_check.h, or a contradiction to what is stored) would hold up all
// others for ever. This row alone is set aside and reported. Status is published after the commit
// of the rows that it reflects, never before. The writer returns three facts: the batch through
// which all is durable, the rows up to there that were set aside, and whether the last attempt
// failed. A commit that does not come back, because the disk hangs, is a failure for as long.
//
// Waiting batches become one transaction, in order. Thereby the writer falls behind a slow disk by
// no more than one flush.
//
// Rows are kept in memory until they are durable, so a disk that stays full would fill the memory,
// too. RoomForRows says when so many wait that no command may add others.
//
// A thread offers batches and status, and the other one, or the same, takes the turns.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/clock/clock.h"
#include "daemon/clock/wall_time.h"
#include "daemon/loop/spsc_queue.h"
#include "daemon/status/status_batch.h"
#include "fleet/records.h"
#include "protocol/base/result.h"

namespace focalfleet {

class StoreWriter {
 public:
  /// Functions that a turn calls.
  struct Sinks {
    /// As Store::Commit. Where the error is kInvalid and concerns one row, `refused` is the index
    /// of this row; else it is the number of rows.
    std::function<Status(std::span<const Row>, WallTime, std::size_t* refused)> commit;
    /// The status is taken over. False: the publisher is behind, and the status is untouched; it is
    /// offered again in a later turn.
    std::function<bool(StatusBatch*)> publish;
    std::function<void(const AlarmValue&)> alarm;
    std::function<void(const std::string&)> log_error;
    std::function<void(const std::string&)> log_info;
    /// Called in each turn, and before each call of the disk.
    std::function<void()> alive = [] {};
    /// A piece of upkeep that takes no longer than a commit does. True: more is due. Called where
    /// no rows wait, once an upkeep_period or as long as more is due.
    std::function<bool()> upkeep = [] { return false; };
    std::chrono::milliseconds retry_period{1000};
    /// The time of a commit, or of a piece of upkeep, from which it hangs. A disk that is well
    /// flushes within a second, and a slow one within some. With half of it such a disk would stop
    /// commands now and then; with twice as much they would wait as long for nothing.
    std::chrono::milliseconds hangs_after{10'000};
    std::chrono::milliseconds upkeep_period{3'600'000};
    std::function<std::int64_t()> monotonic_ns = &ReadMonotonicNs;
    std::function<WallTime()> wall = &WallTime::Now;
    std::function<void()> progressed = [] {};  // one of the three facts changed
    std::function<void()> offered = [] {};     // a batch or a status waits for a turn
  };

  /// The reason of a failure that lasts as long as a call of the disk hangs.
  static constexpr const char* kNoAnswer = "the disk does not answer";

  explicit StoreWriter(Sinks sinks);
  StoreWriter(const StoreWriter&) = delete;
  StoreWriter& operator=(const StoreWriter&) = delete;

  // ---- called by the core

  /// The batch will be committed after all earlier ones.
  void Commit(std::uint64_t batch, std::vector<Row> rows);
  /// `status` is taken over. False: the writer is behind, and `status` is untouched; offer newer
  /// values later.
  [[nodiscard]] bool Publish(StatusBatch* status);
  /// Hands over batches that found the queue full, as far as there is room. Call once a turn of the
  /// core.
  void HandOver();

  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  [[nodiscard]] bool failing() const { return failing_ || hangs(); }
  /// A turn waits for the disk.
  [[nodiscard]] bool in_disk() const { return call_began_ns_ != kNoCall; }
  /// A turn has waited for the disk for longer than `hangs_after`.
  [[nodiscard]] bool hangs() const;
  /// Why the last attempt to commit failed or does not end; none: it did not fail, and none hangs.
  [[nodiscard]] std::optional<Error> failure() const;
  /// Rows that were set aside since the last call. Read committed_through() first: all rows set
  /// aside up to that batch are then in this result or in an earlier one.
  std::vector<RefusedRow> TakeRefused();
  [[nodiscard]] std::size_t waiting() const { return batches_.size() + held_.size(); }
  /// Batches that found the queue full.
  [[nodiscard]] std::size_t held() const { return held_.size(); }
  /// Memory of the rows that are not durable yet (loop/row_bytes.h).
  [[nodiscard]] std::size_t bytes_waiting() const { return bytes_waiting_; }
  /// A command may add rows. Errors: kUnavailable: limits::kRowBytesWaiting are exceeded, with the
  /// reason.
  [[nodiscard]] Status RoomForRows() const;

  // ---- called by the thread that takes the turns

  struct Rest {
    bool ended = false;  // no further turn: all is durable and published, or the disk is broken
    /// Until the next turn; none: until something is offered.
    std::optional<std::chrono::milliseconds> wait = {};
  };
  /// Commits what waits and publishes what is ready. `ending`: a broken disk gets one more attempt
  /// only.
  Rest Turn(bool ending);

 private:
  struct Batch {
    std::uint64_t first = 0;   // first of the batches that became this transaction
    std::uint64_t number = 0;  // last of them
    std::vector<Row> rows;
    WallTime at;
    std::size_t bytes = 0;  // of all its rows, also of those that were set aside since
  };

  static constexpr std::int64_t kNoCall = INT64_MAX;

  void Gather();
  void EnterDisk();
  bool TryCommit(bool ending);
  void SetAside(std::size_t row, const std::string& why);
  void NoteFailure(const Error& error);
  void PublishReady(bool ending);
  [[nodiscard]] bool KeepUp();
  [[nodiscard]] bool Idle() const;

  Sinks sinks_;
  SpscQueue<Batch> batches_;
  SpscQueue<StatusBatch> statuses_;
  std::deque<Batch> held_;  // used by the core alone
  std::atomic<std::uint64_t> committed_through_{0};
  std::atomic<std::size_t> bytes_waiting_{0};
  std::atomic<bool> failing_{false};
  std::atomic<std::int64_t> call_began_ns_{kNoCall};

  mutable std::mutex lock_;
  std::vector<RefusedRow> refused_;  // under the lock
  Error last_error_;                 // under the lock

  // Members that turns alone use.
  Batch open_;                         // being committed; empty rows: none
  std::optional<StatusBatch> status_;  // waits for its rows
  bool attempted_ = false;             // the open batch has failed
  std::int64_t retry_at_ns_ = 0;
  std::int64_t upkeep_at_ns_ = INT64_MIN;
  std::uint64_t own_alarms_ = 0;
  int offered_at_end_ = 0;  // status, in vain
};

}  // namespace focalfleet
