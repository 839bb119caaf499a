// A CAN segment: a wire (bus_wire.h), the controllers that stand on it (bus_nodes.h), and the
// frames that wait for it (arbitration.h). When the wire falls idle, the lowest identifier of all
// that wait goes next. The frame holds the wire for its exact number of bits, and is received at
// its end.
//
// Errors follow the standard (ISO 11898-1; Bosch CAN 2.0 part B). A destroyed frame costs its bits
// so far and an error frame (frame_course.h). The error counts at every controller
// (error_rules.h), and the frame is sent again until it gets through. A passive controller waits
// 8 bits more behind its own frames. A frame that no other node acknowledges is sent for ever.
//
// Node 0 is the host's controller; every other is a unit's.
//
// Left out are noise between frames (overload frames) and the up to 20 us in which two nodes may
// start together. Disturbances that only one node sees are left out too, but for that of
// BusFaults::duplicate.
#pragma once

#include <cstdint>

#include "protocol/base/instants.h"
#include "protocol/base/rng.h"
#include "sim/world/bus/arbitration.h"
#include "sim/world/bus/bus_counters.h"
#include "sim/world/bus/bus_disturbances.h"
#include "sim/world/bus/bus_nodes.h"
#include "sim/world/bus/bus_options.h"
#include "sim/world/bus/bus_wire.h"
#include "sim/world/faults.h"

namespace focalfleet::sim {

class Bus {
 public:
  Bus(const BusOptions& options, Rng chance);

  /// Returns the number of another node, from 1 on. The node is there and error-free.
  std::uint32_t Attach() { return nodes_.Attach(); }

  /// `waiting` takes part in arbitration from `ready` on. False: no mailbox left, the bus is dead,
  /// or the host's controller is off.
  bool Offer(const WaitingFrame& waiting, HostInstant ready);

  /// The next instant at which the wire does something: a frame ends, or one can begin.
  [[nodiscard]] HostInstant NextEvent() const;

  struct Heard {
    WaitingFrame sent;
    HostInstant at;
    bool lost = false;                // it took its time on the wire, and no node understood it
    std::uint32_t but_not = kNoNode;  // the one node that refused it
  };
  /// Does what is due at NextEvent(); true: `heard` is a frame that was accepted.
  bool Advance(Heard* heard);

  /// The disturbances of this bus; valid while the bus stays where it is.
  [[nodiscard]] BusDisturbances disturb() { return {&wire_, &nodes_, &arbitration_}; }
  [[nodiscard]] BusFaults& faults() { return faults_; }

  // ---- the visible state

  [[nodiscard]] bool dead() const { return wire_.dead(); }
  [[nodiscard]] const BusNode& node(std::uint32_t number) const { return nodes_[number]; }
  /// The number of frames that wait or are on the wire.
  [[nodiscard]] std::size_t waiting() const {
    return arbitration_.waiting() + (wire_.sending() ? 1 : 0);
  }
  [[nodiscard]] BusCounters counters() const;

 private:
  void Recover(HostInstant now);
  void BeginFrame(HostInstant now);
  bool EndFrame(Heard* heard);
  [[nodiscard]] FrameOnWire DrawCourse(const Arbitration::Winner& winner);

  BusOptions options_;
  Rng chance_;
  BusFaults faults_;
  BusWire wire_;
  BusNodes nodes_;
  Arbitration arbitration_;
  BusCounters counters_;  // of frames; each part has its own
};

}  // namespace focalfleet::sim
