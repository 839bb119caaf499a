// The disturbances of a world: tests, load testers and planned faults cut power, break buses and
// make units and buses misbehave. World::disturb() gives them.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/ids.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/messages.h"
#include "sim/world/faults.h"

namespace focalfleet::sim {

class WorldCore;

/// Every disturbance acts at the world's now().
class Disturbances {
 public:
  /// `core` outlives this.
  explicit Disturbances(WorldCore* core) : core_(core) {}

  void PowerCut(UnitId unit);  // at once, whatever the unit does
  void PowerOn(UnitId unit);
  void KillBus(BusId bus);  // waiting frames are lost
  void ReviveBus(BusId bus);
  void StickBus(BusId bus);  // dominant, until it is released
  void ReleaseBus(BusId bus);
  void RestartHost(BusId bus);   // the host's controller, if it is bus-off
  void ThrowHostOff(BusId bus);  // as after a short circuit
  void Unplug(UnitId unit);      // from its bus; it keeps its power
  void Plug(UnitId unit);
  /// The unit's controller sends this frame whenever arbitration lets it; none: no more.
  void Babble(UnitId unit, const std::optional<CanFrame>& frame);
  void RaiseFault(UnitId unit, FaultCode code, Axis axis = Axis::kTheta);
  void SpoilFlash(UnitId unit, FlashDamage damage);
  /// Null where there is no such unit.
  [[nodiscard]] UnitFaults* faults(UnitId unit);
  [[nodiscard]] BusFaults* faults(BusId bus);

 private:
  WorldCore* core_;
};

}  // namespace focalfleet::sim
