// A CAN segment whose traffic can be disturbed: nodes lose their power or their plug, or babble,
// and the wire is cut or stuck.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/instants.h"
#include "protocol/wire/can_frame.h"
#include "sim/world/bus/traffic.h"

namespace focalfleet::sim {

/// Pre of every disturbance: `now` is not before any earlier instant, nor after NextEvent().
class Bus : public BusTraffic {
 public:
  using BusTraffic::BusTraffic;

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
  void CutOff(std::uint32_t node, HostInstant now);
  [[nodiscard]] std::uint32_t BitsOnWire(HostInstant now) const;
};

}  // namespace focalfleet::sim
