// The disturbances of one bus: nodes lose their power or their plug, or babble, and the wire is cut
// or stuck.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "sim/world/bus/arbitration.h"
#include "sim/world/bus/bus_nodes.h"
#include "sim/world/bus/bus_wire.h"

namespace focalfleet::sim {

/// Pre of every disturbance: `now` is not before any earlier instant, nor after Bus::NextEvent().
class BusDisturbances {
 public:
  /// All parts are those of one bus and outlive this.
  BusDisturbances(BusWire* wire, BusNodes* nodes, Arbitration* arbitration)
      : wire_(wire), nodes_(nodes), arbitration_(arbitration) {}

  void Kill(HostInstant now);
  void Revive(HostInstant now);
  /// A node loses its power and its waiting frames. When power returns its controller is as new.
  void PowerOff(std::uint32_t node, HostInstant now);
  void PowerOn(std::uint32_t node, HostInstant now);
  /// A node is unplugged: its frames go into the void, and it becomes passive if it has frames to
  /// send. The frames stay, as far as it has mailboxes.
  void Unplug(std::uint32_t node, HostInstant now);
  void Plug(std::uint32_t node, HostInstant now);
  /// `node` sends this frame from now on whenever arbitration lets it; none: no more.
  void Babble(std::uint32_t node, const std::optional<CanFrame>& frame, HostInstant now);
  /// The wire is dominant, whatever the nodes drive, until it is released.
  void Stick(HostInstant now);
  void Release(HostInstant now);
  /// The host's controller begins its recovery, if it is off.
  void RestartHost(HostInstant now);
  /// The host's controller is off from now on, as after a short circuit.
  void ThrowHostOff(HostInstant now);

 private:
  BusWire* wire_;
  BusNodes* nodes_;
  Arbitration* arbitration_;
};

}  // namespace focalfleet::sim
