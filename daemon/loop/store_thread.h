// The thread that may wait for a disk, so that no other has to. It commits batches of rows in order
// and never drops one: what cannot be written now is tried again each second, and everything behind
// it waits. A row that can never be written (fleet/row_check.h, or a contradiction to what is
// stored) would hold up all others for ever: it alone is set aside, and told. Status goes out after
// the commit of all that it tells of, never before. The thread hands back three facts: through
// which batch all is durable, which rows up to there were set aside, and whether the last attempt
// failed.
//
// A slow disk makes the batches that wait one transaction, in order, so that it never falls behind
// by more than one flush.
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
  /// What the thread does with what it is given; called on the thread.
  struct Sinks {
    /// As Store::Commit: where the error is kInvalid, `refused` is the index of the row that it is
    /// about, if it is about one, else the number of rows.
    std::function<Status(std::span<const Row>, WallTime, std::size_t* refused)> commit;
    /// True: something still waits to go out, call again soon (with nothing new).
    std::function<bool(const StatusBatch&)> publish;
    std::function<void(const AlarmValue&)> alarm;
    std::function<void(const std::string&)> log_error;
    std::function<void(const std::string&)> log_info;
    std::chrono::milliseconds retry_period{1000};
  };

  /// `progressed` is raised when what it hands back changed; it outlives the thread.
  /// Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<StoreThread>> Create(Sinks sinks, const EventSignal* progressed);
  StoreThread(const StoreThread&) = delete;
  StoreThread& operator=(const StoreThread&) = delete;
  ~StoreThread();

  // ---- the giving thread

  void Commit(std::uint64_t batch, std::vector<Row> rows);
  /// False: the thread is behind; offer newer values later. `status` is untouched.
  [[nodiscard]] bool Publish(StatusBatch* status);
  /// Batches that found the queue full, handed over as room comes. Call now and then.
  void HandOver();
  /// All is durable and told, the thread has ended. Errors: what the last attempt to commit failed
  /// with; then rows are lost.
  Status Finish();

  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  [[nodiscard]] bool failing() const { return failing_; }
  /// Rows that were set aside since the last call. All of the batches through a committed_through()
  /// that was read before are among these or were handed over earlier.
  std::vector<RefusedRow> TakeRefused();
  [[nodiscard]] std::size_t waiting() const { return batches_.size() + held_.size(); }

 private:
  struct Batch {
    std::uint64_t first = 0;   // of the batches that became this one transaction
    std::uint64_t number = 0;  // the last of them
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
  [[nodiscard]] bool Idle() const;

  Sinks sinks_;
  const EventSignal* progressed_;
  EventSignal wake_;
  SpscQueue<Batch> batches_;
  SpscQueue<StatusBatch> statuses_;
  std::deque<Batch> held_;  // of the giving thread
  std::atomic<std::uint64_t> committed_through_{0};
  std::atomic<bool> failing_{false};
  std::atomic<bool> ending_{false};

  std::mutex refused_lock_;
  std::vector<RefusedRow> refused_;  // under the lock

  // Of the thread alone.
  Batch open_;  // being committed; empty rows: none
  std::optional<StatusBatch> status_;
  bool publish_again_ = false;
  bool attempted_ = false;  // the open batch has failed
  std::chrono::steady_clock::time_point retry_at_;
  std::uint64_t own_alarms_ = 0;
  Error last_error_;

  std::thread thread_;
};

}  // namespace focalfleet
