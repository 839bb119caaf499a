// One CAN segment: frames that wait, one frame on the wire, and a bit clock. When the wire falls
// idle the lowest identifier of all that wait goes next (equal ones in order of coming: only one
// node has that identifier); it holds the wire for its exact number of bits, 131..160 us for eight
// bytes at 1 Mbit/s, and is heard at its end.
#pragma once

#include <cstdint>
#include <queue>
#include <vector>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "protocol/wire/can_frame.h"
#include "sim/faults.h"

namespace focalfleet::sim {

struct BusCounters {
  std::uint64_t host_frames = 0;  // through the wire
  std::uint64_t unit_frames = 0;
  std::uint64_t bits = 0;  // exact, stuff bits included
  DurationNs busy{0};
  std::uint64_t dropped = 0;      // by a planted fault or because the bus is dead
  std::uint64_t refused = 0;      // no mailbox left
  std::uint32_t waiting_max = 0;  // most frames that ever waited at once

  /// Share of the time in which the wire was taken.
  [[nodiscard]] double Load(DurationNs elapsed) const {
    return elapsed.ns > 0 ? static_cast<double>(busy.ns) / static_cast<double>(elapsed.ns) : 0;
  }
};

class Bus {
 public:
  struct Options {
    std::uint32_t bit_rate_bps = 1'000'000;
    bool bit_clock = true;  // false: a frame takes no time
    std::uint32_t mailboxes_max = 4096;
  };
  Bus(const Options& options, Rng chance) : options_(options), chance_(chance) {}

  struct Waiting {
    CanFrame frame;
    bool from_unit = false;
    std::uint32_t sender = 0;  // row of the unit, or the host's client
  };
  /// `waiting` takes part in arbitration from `ready` on. False: no mailbox left, or the bus is
  /// dead.
  bool Offer(const Waiting& waiting, HostInstant ready);

  /// When the wire next does something: a frame ends, or one can begin.
  [[nodiscard]] HostInstant NextEvent() const;

  struct Heard {
    Waiting sent;
    HostInstant at;
    bool lost = false;  // it took its time on the wire, and nobody understood it
  };
  /// Does what is due at NextEvent(); true: `heard` is a frame that ended.
  bool Advance(Heard* heard);

  void Kill();
  void Revive() { dead_ = false; }
  [[nodiscard]] bool dead() const { return dead_; }
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
  using Heap = std::priority_queue<Entry, std::vector<Entry>, Order>;

  void Admit(const Entry& entry);
  void BeginFrame();

  Options options_;
  Rng chance_;
  BusFaults faults_;
  BusCounters counters_;
  Heap<LaterFirst> later_;
  Heap<HigherFirst> ready_;
  Waiting on_wire_;
  HostInstant idle_at_{0};  // end of the frame on the wire, or of the last one
  std::uint64_t order_ = 0;
  bool sending_ = false;
  bool dead_ = false;
};

}  // namespace focalfleet::sim
