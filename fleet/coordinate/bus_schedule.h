// The schedule of a bus decides which frames go onto it next. Frames wait here, not in the kernel,
// so that a stop or a start passes all of them. At most `horizon` of bus time is handed to the port
// ahead of the bit clock. A request is charged with the bits of its answer too, so an upload fills
// the bus without drowning the replies. Frames of one priority leave in the order in which they
// came. On a bus with CAN FD, consecutive staging frames leave together. They are charged as the
// group that the port makes of them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "fleet/coordinate/effects.h"
#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/frame_bits.h"

namespace focalfleet {

class BusSchedule {
 public:
  struct Entry {
    CanFrame frame;
    std::uint32_t reply_bits = 0;         // charged with the frame; 0: no answer comes
    std::optional<PositionerIndex> asks;  // listed in `asked` when its request leaves
  };

  explicit BusSchedule(const BusRates& rates) : rates_(rates) {}

  /// False where the queue is full (limits::kFramesPerBusQueued): the caller asks again later.
  [[nodiscard]] bool Enqueue(const Entry& entry);

  /// Moves what fits before now + horizon to `frames`, and the units whose requests left to
  /// `asked`.
  void Release(HostInstant now, DurationNs horizon, BusId bus, std::vector<OutFrame>* frames,
               std::vector<PositionerIndex>* asked);

  /// Charges the bus time of a frame that did not pass through here (a stop, an unasked report).
  void Charge(HostInstant now, std::uint32_t bits);

  /// Releases nothing before `until`. A stop of all has the highest identifier of all stops, so any
  /// frame handed to a controller beside it may win arbitration against it.
  void Hold(HostInstant until) { held_until_ = std::max(held_until_, until); }

  /// When Release has something to do again; kNever while the queue is empty.
  [[nodiscard]] HostInstant ReadyAt(DurationNs horizon) const;

  /// Drops the frames that wait for one unit (it was stopped, or fell silent). Returns how many.
  std::size_t Drop(NodeId node);

  [[nodiscard]] std::size_t waiting() const { return waiting_; }

 private:
  static constexpr std::size_t kPriorities = 8;

  /// A queue in one piece of memory, which it keeps: once grown it allocates nothing more.
  class Queue {
   public:
    [[nodiscard]] bool empty() const { return size() == 0; }
    [[nodiscard]] std::size_t size() const { return entries_.size() - front_; }
    [[nodiscard]] const Entry& operator[](std::size_t i) const { return entries_[front_ + i]; }
    void PushBack(const Entry& entry);
    void PopFront();
    std::size_t Drop(NodeId node);

   private:
    std::vector<Entry> entries_;
    std::size_t front_ = 0;  // entries before it have left
  };

  /// The form of the front of `queue` on the wire. Pre: it is not empty.
  [[nodiscard]] OnWire Next(const Queue& queue) const;

  std::array<Queue, kPriorities> queue_;
  std::size_t waiting_ = 0;
  HostInstant busy_until_{INT64_MIN};
  HostInstant held_until_{INT64_MIN};
  BusRates rates_;
};

}  // namespace focalfleet
