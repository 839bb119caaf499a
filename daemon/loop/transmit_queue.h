// Frames of one bus that the coordinator has released and the port has not taken yet. The queue is
// usually empty, because the coordinator follows the bit clock. Frames wait when an interface's
// queue is full or a peer does not read.
//
// Stop frames (priority 0) overtake all others. A start signal says "begin so long after this
// frame", so the time that it waited here is taken off its delay. A start signal that waited past
// its instant is discarded. A late start would be worse than none, because the neighbours of the
// unit rely on the common instant.
#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "daemon/status/transmit_queue_counters.h"
#include "protocol/base/instants.h"
#include "protocol/base/limits.h"
#include "protocol/link/frame_port.h"

namespace focalfleet {

class TransmitQueue {
 public:
  explicit TransmitQueue(std::size_t capacity = limits::kFramesPerBusQueued)
      : capacity_(capacity) {}

  /// The frame waits. False: there is no room, and the frame is discarded; the coordinator asks the
  /// unit again. Stop frames have as much room of their own.
  bool Put(const CanFrame& frame, HostInstant decided_at);

  /// Offers waiting frames to the port, until it takes no more. `now` shifts start signals. Pre:
  /// where holds_start(), `now` was read just before.
  void Flush(FramePort* port, HostInstant now);

  /// Waiting frames are discarded: after a link was down, none of them is valid any more.
  void Clear();

  /// Whether a waiting frame has to be shifted: only then does Flush use the time.
  [[nodiscard]] bool holds_start() const { return starts_ > 0; }
  [[nodiscard]] std::size_t size() const { return stops_.size() + others_.size(); }
  [[nodiscard]] const TransmitQueueCounters& counters() const { return counters_; }

 private:
  struct Waiting {
    CanFrame frame;
    HostInstant decided_at;
  };
  bool FlushOne(std::deque<Waiting>* queue, FramePort* port, HostInstant now);

  std::size_t capacity_;
  std::deque<Waiting> stops_;
  std::deque<Waiting> others_;
  std::size_t starts_ = 0;
  std::vector<CanFrame> batch_;
  TransmitQueueCounters counters_;
};

}  // namespace focalfleet
