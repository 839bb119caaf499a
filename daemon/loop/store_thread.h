// The thread that may wait for a disk, so that no other has to: it takes the turns of a
// StoreWriter.
#pragma once

#include <atomic>
#include <memory>
#include <thread>

#include "daemon/loop/event_signal.h"
#include "daemon/loop/store_writer.h"

namespace focalfleet {

class StoreThread {
 public:
  using Sinks = StoreWriter::Sinks;

  /// The thread runs. `progressed` is raised when one of the writer's three facts changed; it
  /// outlives the thread. Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<StoreThread>> Create(Sinks sinks, const EventSignal* progressed);
  StoreThread(const StoreThread&) = delete;
  StoreThread& operator=(const StoreThread&) = delete;
  ~StoreThread();

  [[nodiscard]] StoreWriter& writer() { return writer_; }

  // ---- called by the core thread, as those of the writer

  void Commit(std::uint64_t batch, std::vector<Row> rows) {
    writer_.Commit(batch, std::move(rows));
  }
  [[nodiscard]] bool Publish(StatusBatch* status) { return writer_.Publish(status); }
  void HandOver() { writer_.HandOver(); }
  [[nodiscard]] std::uint64_t committed_through() const { return writer_.committed_through(); }
  [[nodiscard]] bool failing() const { return writer_.failing(); }
  [[nodiscard]] std::optional<Error> failure() const { return writer_.failure(); }
  std::vector<RefusedRow> TakeRefused() { return writer_.TakeRefused(); }
  [[nodiscard]] std::size_t waiting() const { return writer_.waiting(); }
  [[nodiscard]] Status RoomForRows() const { return writer_.RoomForRows(); }

  /// A thread that sleeps takes a turn.
  void Wake() const { wake_.Raise(); }
  /// All is durable and published, and the thread has ended. Errors: that of the last attempt to
  /// commit; then rows are lost. kUnavailable: no commit has ended for the writer's `hangs_after`;
  /// then the thread still waits for the disk, and so does the destructor.
  Status Finish();
  [[nodiscard]] bool ended() const { return ended_; }

 private:
  StoreThread(Sinks sinks, const EventSignal* progressed, EventSignal wake);
  Sinks Hooked(Sinks sinks, const EventSignal* progressed);
  void Run();

  EventSignal wake_;
  StoreWriter writer_;
  std::atomic<bool> ending_{false};
  std::atomic<bool> ended_{false};
  std::thread thread_;
};

}  // namespace focalfleet
