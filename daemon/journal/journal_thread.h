// The thread that writes the journal. The core thread gives it the record of each step and never
// waits: where the disk does not keep up, records are dropped, and the journal names the steps that
// it lacks. A journal that cannot be written harms nothing else.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "daemon/journal/journal_file.h"
#include "daemon/loop/event_signal.h"
#include "daemon/loop/spsc_queue.h"
#include "fleet/coordinator.h"

namespace focalfleet::journal {

class JournalThread {
 public:
  struct Options {
    JournalWriter::Options files;
    /// Receives why the journal is not written; an empty text: it is written again. Called on the
    /// thread.
    std::function<void(const std::string&)> tell;
  };

  /// The thread runs. Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<JournalThread>> Create(Options options, LifeRecord life);
  /// Waits until all that was taken is written, or could not be.
  ~JournalThread();

  /// Takes a step. Cost: its inputs and effects are copied as bytes once.
  void Take(const Inputs& inputs, const Effects& effects);

 private:
  JournalThread(Options options, LifeRecord life, EventSignal wake);
  void Run();
  void WriteWaiting();
  Status Write(const std::vector<NumberedRecord>& records);
  void Note(const Status& status);

  Options options_;
  LifeRecord life_;
  EventSignal wake_;
  std::unique_ptr<JournalWriter> writer_;  // none: not opened yet
  std::string trouble_;                    // as last noted
  std::uint64_t steps_ = 0;
  SpscQueue<NumberedRecord> waiting_;
  std::atomic<std::size_t> waiting_bytes_{0};
  std::atomic<std::uint64_t> dropped_{0};  // steps that found no room
  std::atomic<bool> ending_{false};
  std::thread thread_;  // last: it uses all members above
};

}  // namespace focalfleet::journal
