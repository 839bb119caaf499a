// Frames of one bus that the coordinator has let go and the port has not taken yet. Usually empty:
// the coordinator follows the bit clock. It fills when an interface's queue is full or a peer does
// not read.
//
// Stop frames (priority 0) pass everything. A start signal says "begin so long after this frame",
// so the time that it waited here is taken off its delay; one that waited past its instant is
// thrown away, because late would be worse than never: the unit's neighbours rely on the common
// instant.
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

  /// False: no room, and the frame is gone; whoever asked the unit asks again. There is always room
  /// for as many stop frames again.
  bool Put(const CanFrame& frame, HostInstant decided_at);

  /// Offers the port what waits, until it takes no more. `now`: read just before where
  /// holds_start(), it shifts start signals.
  void Flush(FramePort* port, HostInstant now);

  /// Throws away what waits: after a link was down nothing of it is true any more.
  void Clear();

  /// Some of what waits has to be shifted: only then does Flush look at the time.
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
