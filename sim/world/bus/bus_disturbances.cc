#include "sim/world/bus/bus_disturbances.h"

namespace focalfleet::sim {

void BusDisturbances::RestartHost(HostInstant now) { nodes_->RestartHost(now); }

void BusDisturbances::ThrowHostOff(HostInstant now) {
  if ((*nodes_)[kHostNode].off || wire_->dead()) return;
  wire_->CutOff(kHostNode, now);
  nodes_->ThrowOff(kHostNode, now);
  arbitration_->Hold(kHostNode);
}

// ---- presence of nodes

void BusDisturbances::PowerOff(std::uint32_t node, HostInstant now) {
  wire_->CutOff(node, now);
  nodes_->PowerOff(node);
  arbitration_->DropAllOf(node);
}

void BusDisturbances::PowerOn(std::uint32_t node, HostInstant now) {
  if (nodes_->PowerOn(node)) arbitration_->LetIn(node, now);
}

void BusDisturbances::Unplug(std::uint32_t node, HostInstant now) {
  if (!(*nodes_)[node].there) return;
  const std::optional<QueuedFrame> cut = wire_->CutOff(node, now);
  if (cut) arbitration_->Hold(*cut);
  nodes_->Unplug(node);
  arbitration_->Hold(node);
}

void BusDisturbances::Plug(std::uint32_t node, HostInstant now) {
  if (nodes_->Plug(node, arbitration_->holds(node), now)) arbitration_->LetIn(node, now);
}

void BusDisturbances::Babble(std::uint32_t node, const std::optional<CanFrame>& frame,
                             HostInstant now) {
  arbitration_->Babble(node, frame, now);
}

// ---- a wire that is dead or stuck

void BusDisturbances::Kill(HostInstant now) {
  if (wire_->dead()) return;
  Release(now);
  if (wire_->sending()) arbitration_->CountDropped();
  arbitration_->DropAll();
  wire_->Kill(now);
}

void BusDisturbances::Revive(HostInstant now) {
  if (wire_->dead()) wire_->Revive(now);
}

void BusDisturbances::Stick(HostInstant now) {
  if (!wire_->can_stick()) return;
  if (!wire_->sending()) nodes_->CountRowsWhileIdle(wire_->idle_at(), now);
  const std::optional<QueuedFrame> destroyed = wire_->Stick(now);
  if (destroyed) arbitration_->Repeat(*destroyed, *nodes_);
}

void BusDisturbances::Release(HostInstant now) {
  if (!wire_->stuck()) return;
  wire_->Release(now);
  nodes_->CountRowsNotBefore(now);
}

}  // namespace focalfleet::sim
