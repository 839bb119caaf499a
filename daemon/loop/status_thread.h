// The thread that publishes status and alarms. A cycle of 5000 units holds it 6 ms with one reader
// of DDS and 200 ms with sixty, so it is not the store's thread: an intent must not wait so long
// for its commit. Batches are published in order. Where the thread is behind, it refuses a batch,
// and the giver offers newer values later.
#pragma once

#include <atomic>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "daemon/loop/event_signal.h"
#include "daemon/loop/spsc_queue.h"
#include "daemon/status/status_batch.h"

namespace focalfleet {

class StatusThread {
 public:
  /// Functions that the thread calls, on itself.
  struct Sinks {
    /// True: some status still waits to go out; the thread calls again soon, with nothing new.
    std::function<bool(const StatusBatch&)> publish;
    std::function<void(const AlarmValue&)> alarm;
    /// A refused batch has room now.
    std::function<void()> room = [] {};
    /// Called in each turn of the thread, and after each Wake.
    std::function<void()> alive = [] {};
  };

  /// The thread runs. Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<StatusThread>> Create(Sinks sinks);
  StatusThread(const StatusThread&) = delete;
  StatusThread& operator=(const StatusThread&) = delete;
  /// Publishes what it was given, and waits for that.
  ~StatusThread();

  // ---- called by one thread, the store's

  /// `status` is taken over. False: the thread is behind, and `status` is untouched.
  [[nodiscard]] bool Publish(StatusBatch* status);
  /// The alarm will be published. The newest alarms that wait are kept: late readers get
  /// no more of them either.
  void Publish(const AlarmValue& alarm);

  /// A thread that sleeps takes a turn. Any thread may call this.
  void Wake() const { wake_.Raise(); }

 private:
  StatusThread(Sinks sinks, EventSignal wake);
  void Run();
  void PublishAlarms();

  Sinks sinks_;
  EventSignal wake_;
  SpscQueue<StatusBatch> batches_;
  std::atomic<bool> refused_{false};
  std::atomic<bool> ending_{false};
  std::mutex lock_;
  std::deque<AlarmValue> alarms_;  // under the lock
  std::thread thread_;
};

}  // namespace focalfleet
