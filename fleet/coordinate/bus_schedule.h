// What may go onto one bus next. Frames wait here, not in the kernel, so that a stop or a start
// passes all of them: at most `horizon` of bus time is handed to the port ahead of the bit clock. A
// request is charged with the bits of its answer too, so an upload fills the bus without drowning
// the replies. Frames of one priority leave in the order in which they came. On a bus with CAN FD
// staging frames that wait one behind the other leave together, charged as the group that the port
// makes of them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "fleet/coordinator.h"
#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {

class BusSchedule {
 public:
  struct Entry {
    CanFrame frame;
    std::uint32_t reply_bits = 0;         // charged with the frame; 0: no answer comes
    std::optional<PositionerIndex> asks;  // told when its request leaves
  };

  explicit BusSchedule(const BusRates& rates) : rates_(rates) {}

  /// False where the queue is full (limits::kFramesPerBusQueued): the caller asks again later.
  [[nodiscard]] bool Enqueue(const Entry& entry);

  /// Moves what fits before now + horizon to `frames`, and the units whose requests left to
  /// `asked`.
  void Release(HostInstant now, DurationNs horizon, BusId bus, std::vector<OutFrame>* frames,
               std::vector<PositionerIndex>* asked);

  /// Time on the bus that a frame took which did not pass through here (a stop, an unasked report).
  void Charge(HostInstant now, std::uint32_t bits);

  /// Releases nothing before `until`: a stop of all has the highest identifier of all stops, and
  /// whatever is handed to a controller beside it may win arbitration against it.
  void Hold(HostInstant until) { held_until_ = std::max(held_until_, until); }

  /// When Release has something to do again; kNever while the queue is empty.
  [[nodiscard]] HostInstant ReadyAt(DurationNs horizon) const;

  /// Forgets what waits for one unit (it was stopped, or fell silent). Returns how many frames
  /// went.
  std::size_t Drop(NodeId node);

  [[nodiscard]] std::size_t waiting() const { return waiting_; }

 private:
  static constexpr std::size_t kPriorities = 8;

  /// What the front of `queue` becomes on the wire. Pre: it is not empty.
  [[nodiscard]] OnWire Next(const std::deque<Entry>& queue) const;

  std::array<std::deque<Entry>, kPriorities> queue_;
  std::size_t waiting_ = 0;
  HostInstant busy_until_{INT64_MIN};
  HostInstant held_until_{INT64_MIN};
  BusRates rates_;
};

}  // namespace focalfleet
