// Counters of the transmit queue of one bus.
#pragma once

#include <cstdint>

namespace focalfleet {

struct TransmitQueueCounters {
  std::uint64_t refused = 0;      // frames that found no room
  std::uint64_t stale = 0;        // frames discarded because the link went down
  std::uint64_t late_starts = 0;  // start signals that missed their instant
};

}  // namespace focalfleet
