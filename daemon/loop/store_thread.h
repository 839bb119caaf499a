// The thread that may wait for a disk, so that no other has to. Batches of rows are committed in
// order, and none is dropped. A batch that cannot be written now is tried again each second, and
// all later ones wait. A row that can never be written (fleet/row_check.h, or a contradiction to
// what is stored) would hold up all others for ever. This row alone is set aside and reported.
// Status is published after the commit of the rows that it reflects, never before. The thread
// returns three facts: the batch through which all is durable, the rows up to there that were set
// aside, and whether the last attempt failed.
//
// Waiting batches become one transaction, in order. Thereby the thread falls behind a slow disk by
// no more than one flush.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <thread>
#include <vector>

#include "daemon/clock/wall_time.h"
#include "daemon/loop/event_signal.h"
#include "daemon/loop/spsc_queue.h"
#include "daemon/status/status_batch.h"
#include "fleet/records.h"

namespace focalfleet {

class StoreThread {
 public:
  /// Functions that the thread calls, on itself.
  struct Sinks {
    /// As Store::Commit. Where the error is kInvalid and concerns one row, `refused` is the index
    /// of this row; else it is the number of rows.
    std::function<Status(std::span<const Row>, WallTime, std::size_t* refused)> commit;
    /// The status is taken over. False: the publisher is behind, and the status is untouched; it is
    /// offered again after the next Wake.
    std::function<bool(StatusBatch*)> publish;
    std::function<void(const AlarmValue&)> alarm;
    std::function<void(const std::string&)> log_error;
    std::function<void(const std::string&)> log_info;
    /// Called in each turn of the thread, and after each Wake.
    std::function<void()> alive = [] {};
    /// A piece of upkeep that takes no longer than a commit does. True: more is due. Called where
    /// no rows wait, once an upkeep_period or as long as more is due.
    std::function<bool()> upkeep = [] { return false; };
    std::chrono::milliseconds retry_period{1000};
    std::chrono::milliseconds upkeep_period{3'600'000};
  };

  /// The thread runs. `progressed` is raised when one of the three facts changed; it outlives the
  /// thread. Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<StoreThread>> Create(Sinks sinks, const EventSignal* progressed);
  StoreThread(const StoreThread&) = delete;
  StoreThread& operator=(const StoreThread&) = delete;
  ~StoreThread();

  // ---- called by the core thread

  /// The batch will be committed after all earlier ones.
  void Commit(std::uint64_t batch, std::vector<Row> rows);
  /// `status` is taken over. False: the thread is behind, and `status` is untouched; offer newer
  /// values later.
  [[nodiscard]] bool Publish(StatusBatch* status);
  /// Hands over batches that found the queue full, as far as there is room. Call once a turn.
  void HandOver();
  /// A thread that sleeps takes a turn.
  void Wake() const { wake_.Raise(); }
  /// All is durable and published, and the thread has ended. Errors: that of the last attempt to
  /// commit; then rows are lost.
  Status Finish();

  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  [[nodiscard]] bool failing() const { return failing_; }
  /// Why the last attempt to commit failed; none: it did not.
  [[nodiscard]] std::optional<Error> failure() const;
  /// Rows that were set aside since the last call. Read committed_through() first: all rows set
  /// aside up to that batch are then in this result or in an earlier one.
  std::vector<RefusedRow> TakeRefused();
  [[nodiscard]] std::size_t waiting() const { return batches_.size() + held_.size(); }

 private:
  struct Batch {
    std::uint64_t first = 0;   // first of the batches that became this transaction
    std::uint64_t number = 0;  // last of them
    std::vector<Row> rows;
    WallTime at;
  };

  StoreThread(Sinks sinks, const EventSignal* progressed, EventSignal wake);
  void Run();
  void Gather();
  bool TryCommit();
  void SetAside(std::size_t row, const std::string& why);
  void NoteFailure(const Error& error);
  void PublishReady();
  [[nodiscard]] bool KeepUp();
  [[nodiscard]] bool Idle() const;

  Sinks sinks_;
  const EventSignal* progressed_;
  EventSignal wake_;
  SpscQueue<Batch> batches_;
  SpscQueue<StatusBatch> statuses_;
  std::deque<Batch> held_;  // used by the core thread alone
  std::atomic<std::uint64_t> committed_through_{0};
  std::atomic<bool> failing_{false};
  std::atomic<bool> ending_{false};

  mutable std::mutex lock_;
  std::vector<RefusedRow> refused_;  // under the lock
  Error last_error_;                 // under the lock

  // Members that the store's thread alone uses.
  Batch open_;                         // being committed; empty rows: none
  std::optional<StatusBatch> status_;  // waits for its rows
  bool attempted_ = false;             // the open batch has failed
  std::chrono::steady_clock::time_point retry_at_;
  std::chrono::steady_clock::time_point upkeep_at_;
  std::uint64_t own_alarms_ = 0;
  int offered_at_end_ = 0;  // status, in vain

  std::thread thread_;
};

}  // namespace focalfleet
