// One CAN segment: frames that wait, one frame on the wire, a bit clock, and the controllers that
// stand on it. When the wire falls idle the lowest identifier of all that wait goes next (equal
// ones in order of coming: only one node has that identifier); it holds the wire for its exact
// number of bits, 131..160 us for eight bytes at 1 Mbit/s, and is heard at its end.
//
// What goes wrong goes wrong by the standard (ISO 11898-1; Bosch CAN 2.0 part B): a frame that is
// destroyed costs its bits so far and an error frame (frame_course.h), counts at every controller
// (error_counters.h) and is sent again until it is through; a controller that goes passive waits 8
// bits more behind its own frames; one that goes off neither sends nor hears until it has seen 128
// times eleven recessive bits. A frame that nobody else is there to acknowledge is sent for ever.
//
// Node 0 is the host's controller; every other is a unit's. A node without trouble costs nothing:
// counters are only gone through while one of them is not zero.
//
// Left out: noise between frames (overload frames), disturbances that only one node sees but for
// the one of BusFaults::duplicate, and the up to 20 us in which two nodes may start together.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <queue>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "protocol/wire/can_frame.h"
#include "sim/world/bus/error_counters.h"
#include "sim/world/bus/frame_course.h"
#include "sim/world/faults.h"

namespace focalfleet::sim {

/// All time since the start is idle, busy or dead; of busy, `destroyed` and `stuck` were in vain.
struct BusCounters {
  std::uint64_t host_frames = 0;  // through the wire
  std::uint64_t unit_frames = 0;
  std::uint64_t bits = 0;  // of them; exact, stuff bits included
  DurationNs busy{0};
  std::uint64_t dropped = 0;      // by a planted fault, or because bus or sender went off or away
  std::uint64_t refused = 0;      // no mailbox left
  std::uint32_t waiting_max = 0;  // most frames that ever waited at once

  std::array<std::uint64_t, kFrameErrorCount> errors{};  // error frames by what the sender saw
  std::uint64_t error_bits = 0;      // of destroyed attempts with their error frames
  std::uint64_t repeats = 0;         // attempts that follow a destroyed one
  std::uint64_t received_twice = 0;  // accepted by receivers, and sent again all the same
  std::uint64_t babbled = 0;         // frames of a babbling node that got through
  std::uint64_t went_passive = 0;    // controllers, times
  std::uint64_t went_off = 0;
  std::uint64_t recovered = 0;  // from off
  DurationNs destroyed{0};
  DurationNs stuck{0};  // dominant without a frame
  DurationNs dead{0};
  DurationNs idle{0};  // until the last frame began

  [[nodiscard]] std::uint64_t error_frames() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t count : errors) sum += count;
    return sum;
  }
  /// Share of the time in which the wire was taken.
  [[nodiscard]] double Load(DurationNs elapsed) const {
    return elapsed.ns > 0 ? static_cast<double>(busy.ns) / static_cast<double>(elapsed.ns) : 0;
  }
};

class Bus {
 public:
  static constexpr std::uint32_t kHost = 0;  // its node
  static constexpr std::uint32_t kNobody = UINT32_MAX;

  struct Options {
    std::uint32_t bit_rate_bps = 1'000'000;
    bool bit_clock = true;  // false: a frame takes no time, and nothing destroys it
    std::uint32_t mailboxes_max = 4096;
    HostInstant start{0};
    /// From the host's bus-off to its restart; kNever: it waits for RestartHost. Units begin their
    /// recovery at once.
    DurationNs host_restart = Milliseconds(1000);
  };
  Bus(const Options& options, Rng chance);

  /// The number of another node, from 1 on. It is there and well.
  std::uint32_t Attach();

  struct Waiting {
    CanFrame frame;
    bool from_unit = false;
    std::uint32_t sender = 0;  // node of the unit, or the host's client
  };
  /// `waiting` takes part in arbitration from `ready` on. False: no mailbox left, the bus is dead,
  /// or the host's controller is off.
  bool Offer(const Waiting& waiting, HostInstant ready);

  /// When the wire next does something: a frame ends, or one can begin.
  [[nodiscard]] HostInstant NextEvent() const;

  struct Heard {
    Waiting sent;
    HostInstant at;
    bool lost = false;                // it took its time on the wire, and nobody understood it
    std::uint32_t but_not = kNobody;  // the one node that refused it
  };
  /// Does what is due at NextEvent(); true: `heard` is a frame that was accepted.
  bool Advance(Heard* heard);

  // ---- violence, at `now`. Pre: now is not before anything told so far, nor after NextEvent().

  void Kill(HostInstant now);
  void Revive(HostInstant now);
  [[nodiscard]] bool dead() const { return dead_; }
  /// A node loses its power, and what it wanted to say; with it comes back a controller as new.
  void PowerOff(std::uint32_t node, HostInstant now);
  void PowerOn(std::uint32_t node, HostInstant now);
  /// A node's plug is open: it sends into the void, goes passive if it has something to say, and
  /// keeps that, as far as it has mailboxes.
  void Unplug(std::uint32_t node, HostInstant now);
  void Plug(std::uint32_t node, HostInstant now);
  /// From now on `node` sends this frame whenever arbitration lets it; none: no more.
  void Babble(std::uint32_t node, const std::optional<CanFrame>& frame, HostInstant now);
  /// The wire is dominant, whatever anybody drives, until it is released.
  void Stick(HostInstant now);
  void Release(HostInstant now);
  /// The host's controller begins its recovery, if it is off.
  void RestartHost(HostInstant now);
  /// The host's controller is off from now on, as after a short circuit.
  void ThrowHostOff(HostInstant now);

  // ---- what can be seen

  /// False: it is away or off, and neither sends nor hears.
  [[nodiscard]] bool Hears(std::uint32_t node) const {
    return nodes_[node].there && !nodes_[node].off;
  }
  [[nodiscard]] const ErrorCounters& errors(std::uint32_t node) const {
    return nodes_[node].errors;
  }
  [[nodiscard]] Confinement state(std::uint32_t node) const {
    return nodes_[node].off ? Confinement::kOff : nodes_[node].errors.state();
  }
  [[nodiscard]] std::size_t waiting() const {
    return ready_.size() + later_.size() + (sending_ ? 1 : 0);
  }
  [[nodiscard]] const BusCounters& counters() const { return counters_; }
  [[nodiscard]] BusFaults& faults() { return faults_; }

 private:
  struct Entry {
    HostInstant ready;
    std::uint64_t order = 0;
    Waiting waiting;
    bool repeated = false;
    [[nodiscard]] std::uint32_t node() const { return waiting.from_unit ? waiting.sender : kHost; }
  };
  struct LaterFirst {  // of a heap whose top is the one that is ready soonest
    bool operator()(const Entry& a, const Entry& b) const {
      return a.ready != b.ready ? a.ready > b.ready : a.order > b.order;
    }
  };
  struct HigherFirst {  // of a heap whose top wins arbitration
    bool operator()(const Entry& a, const Entry& b) const {
      return a.waiting.frame.id != b.waiting.frame.id ? a.waiting.frame.id > b.waiting.frame.id
                                                      : a.order > b.order;
    }
  };
  template <class Order>
  struct Heap : std::priority_queue<Entry, std::vector<Entry>, Order> {
    void MoveAllOf(std::uint32_t node, std::vector<Entry>* to);
  };

  struct Node {
    ErrorCounters errors;
    bool there = true;               // has power and is plugged in
    bool off = false;                // bus-off
    std::uint32_t rows_missing = 0;  // of eleven recessive bits, until it is back
    HostInstant counts_from{0};      // those rows
    std::vector<Entry> kept;         // while it cannot send
  };
  struct Babbler {
    std::uint32_t node;
    CanFrame frame;
    HostInstant since;
  };

  [[nodiscard]] DurationNs Bits(std::uint32_t bits) const;
  [[nodiscard]] HostInstant NextBegin() const;
  [[nodiscard]] HostInstant NextRecovery() const;
  [[nodiscard]] HostInstant BackAt(const Node& node) const;
  void Admit(const Entry& entry);
  /// The entry that wins arbitration at `now`; none: only a suspended node has any.
  [[nodiscard]] std::optional<Entry> Arbitrate(HostInstant now);
  [[nodiscard]] std::optional<Entry> TakeReady(HostInstant now);
  void BeginFrame(HostInstant now);
  [[nodiscard]] FrameCourse DrawCourse();
  [[nodiscard]] std::uint32_t DrawReceiver(std::uint32_t sender);
  bool EndFrame(Heard* heard);
  void Charge(DurationNs taken);
  void CountWell(std::uint32_t sender);
  void CountError(std::uint32_t sender);
  template <class Change>
  void Count(std::uint32_t node, HostInstant now, const Change& change);
  void GoOff(std::uint32_t node, HostInstant now);
  void CountRowsWhileIdle(HostInstant now);
  void CountRowOfFrame();
  void RecoverThrough(HostInstant now);
  void Leave(std::uint32_t node, HostInstant now);
  void Rejoin(std::uint32_t node, HostInstant now);
  void StickOn(HostInstant now);
  [[nodiscard]] std::uint32_t BitsOnWire(HostInstant now) const;

  Options options_;
  Rng chance_;
  BusFaults faults_;
  BusCounters counters_;
  Heap<LaterFirst> later_;
  Heap<HigherFirst> ready_;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> off_nodes_;
  std::vector<Babbler> babblers_;
  std::uint32_t hearing_ = 1;  // nodes that are there and not off
  std::uint32_t unclean_ = 0;  // nodes with a counter that is not zero

  Entry on_wire_;
  FrameCourse course_;
  std::uint32_t refusing_ = kNobody;  // the receiver that does so, of this frame
  HostInstant began_at_{0};           // the frame on the wire
  HostInstant idle_at_{0};            // end of the frame on the wire, or of the last one
  std::uint64_t order_ = 0;
  bool sending_ = false;
  bool abandoned_ = false;  // whoever sends the frame on the wire is gone
  bool babbling_ = false;   // it is a babbler's

  std::uint32_t suspended_ = kNobody;  // sent last and is passive
  HostInstant suspended_until_{0};
  HostInstant held_until_{0};  // all that is ready is the suspended node's

  HostInstant stuck_at_ = kNever;
  HostInstant stuck_step_at_ = kNever;
  std::uint32_t stuck_sender_ = kNobody;
  std::uint32_t stuck_steps_ = 0;
  HostInstant dead_at_{0};
  bool dead_ = false;
};

}  // namespace focalfleet::sim
