// A CAN segment: frames that wait, the frame on the wire, a bit clock, and the controllers that
// stand on the wire. When the wire falls idle, the lowest identifier of all that wait goes next
// (arbitration_queue.h). The frame holds the wire for its exact number of bits, 131..160 us for
// eight bytes at 1 Mbit/s, and is received at its end.
//
// Errors follow the standard (ISO 11898-1; Bosch CAN 2.0 part B). A destroyed frame costs its bits
// so far and an error frame (frame_course.h). The error counts at every controller
// (error_counters.h), and the frame is sent again until it gets through. A passive controller waits
// 8 bits more behind its own frames. A controller that is off neither sends nor receives until it
// has seen 128 times eleven recessive bits. A frame that no other node acknowledges is sent for
// ever.
//
// Node 0 is the host's controller; every other is a unit's. A node without errors costs nothing:
// counters are only updated while one of them is not zero.
//
// Left out are noise between frames (overload frames) and the up to 20 us in which two nodes may
// start together. Disturbances that only one node sees are left out too, but for that of
// BusFaults::duplicate.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/frame_bits.h"
#include "sim/world/bus/arbitration_queue.h"
#include "sim/world/bus/bus_counters.h"
#include "sim/world/bus/bus_nodes.h"
#include "sim/world/bus/error_counters.h"
#include "sim/world/bus/frame_course.h"
#include "sim/world/faults.h"

namespace focalfleet::sim {

class BusTraffic {
 public:
  static constexpr std::uint32_t kHost = kHostNode;
  static constexpr std::uint32_t kNobody = kNoNode;

  struct Options {
    std::uint32_t bit_rate_bps = 1'000'000;
    bool bit_clock = true;  // false: a frame takes no time, and nothing destroys it
    std::uint32_t mailboxes_max = 4096;
    HostInstant start{0};
    /// The time from the host's bus-off to its restart; kNever: the host waits for RestartHost.
    /// Units begin their recovery at once.
    DurationNs host_restart = Milliseconds(1000);

    /// The time of `bits` on the wire.
    [[nodiscard]] DurationNs Bits(std::uint32_t bits) const { return BitTime(bits, bit_rate_bps); }
  };
  BusTraffic(const Options& options, Rng chance);

  /// Returns the number of another node, from 1 on. The node is there and error-free.
  std::uint32_t Attach();

  using Waiting = WaitingFrame;
  /// `waiting` takes part in arbitration from `ready` on. False: no mailbox left, the bus is dead,
  /// or the host's controller is off.
  bool Offer(const Waiting& waiting, HostInstant ready);

  /// The next instant at which the wire does something: a frame ends, or one can begin.
  [[nodiscard]] HostInstant NextEvent() const;

  struct Heard {
    Waiting sent;
    HostInstant at;
    bool lost = false;                // it took its time on the wire, and no node understood it
    std::uint32_t but_not = kNobody;  // the one node that refused it
  };
  /// Does what is due at NextEvent(); true: `heard` is a frame that was accepted.
  bool Advance(Heard* heard);

  // ---- the visible state

  [[nodiscard]] bool dead() const { return dead_; }
  /// False: the node is away or off, and neither sends nor receives.
  [[nodiscard]] bool Hears(std::uint32_t node) const { return nodes_.Hears(node); }
  [[nodiscard]] const ErrorCounters& errors(std::uint32_t node) const {
    return nodes_[node].errors;
  }
  [[nodiscard]] Confinement state(std::uint32_t node) const {
    return nodes_[node].off ? Confinement::kOff : nodes_[node].errors.state();
  }
  [[nodiscard]] std::size_t waiting() const { return queue_.size() + (on_wire_.sending ? 1 : 0); }
  [[nodiscard]] const BusCounters& counters() const { return counters_; }
  [[nodiscard]] BusFaults& faults() { return faults_; }

 protected:
  struct FrameOnWire {
    QueuedFrame entry;
    FrameCourse course;
    std::uint32_t refusing = kNobody;  // the receiver that refuses this frame
    HostInstant began_at{0};
    bool sending = false;
    bool abandoned = false;  // its sender is gone
    bool babbling = false;   // its sender is a babbling node
  };
  struct Suspension {
    std::uint32_t node = kNobody;  // sent the last frame and is passive
    HostInstant until{0};
    HostInstant held_until{0};  // until then only the suspended node has a ready frame
  };
  struct StuckWire {
    HostInstant at = kNever;
    HostInstant step_at = kNever;
    std::uint32_t sender = kNobody;
    std::uint32_t steps = 0;
  };
  struct Babbler {
    std::uint32_t node;
    CanFrame frame;
    HostInstant since;
  };

  [[nodiscard]] HostInstant NextBegin() const;
  void Admit(const QueuedFrame& entry);
  /// The entry that wins arbitration at `now`; none: only a suspended node has any.
  [[nodiscard]] std::optional<QueuedFrame> Arbitrate(HostInstant now);
  void BeginFrame(HostInstant now);
  [[nodiscard]] FrameCourse DrawCourse();
  bool EndFrame(Heard* heard);
  void CountWell(std::uint32_t sender);
  void CountError(std::uint32_t sender);
  template <class Change>
  void Count(std::uint32_t node, HostInstant now, const Change& change);
  void GoOff(std::uint32_t node, HostInstant now);
  void RecoverThrough(HostInstant now);
  void Rejoin(std::uint32_t node, HostInstant now);
  void StickOn(HostInstant now);

  Options options_;
  Rng chance_;
  BusFaults faults_;
  BusCounters counters_;
  ArbitrationQueue queue_;
  BusNodes nodes_;
  std::vector<Babbler> babblers_;
  FrameOnWire on_wire_;
  Suspension suspended_;
  StuckWire stuck_;
  HostInstant idle_at_{0};  // end of the frame on the wire, or of the last one
  std::uint64_t order_ = 0;
  HostInstant dead_at_{0};
  bool dead_ = false;
};

template <class Change>
void BusTraffic::Count(std::uint32_t node, HostInstant now, const Change& change) {
  const BusNodes::Changed changed = nodes_.Count(node, change);
  if (changed.became_passive) ++counters_.went_passive;
  if (changed.must_go_off) GoOff(node, now);
}

}  // namespace focalfleet::sim
