// Unit sessions keep in touch with every unit. A session finds out which unit answers at a place
// and reads what it holds. Later it polls the unit, at rest and in motion, and reports when it
// falls silent, restarts or fails. This is the door; the rooms behind it are identification.h,
// motion_reports.h, unit_parameters.h, sensor_reading.h, count_setting.h and clock_answers.h.
#pragma once

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/inputs.h"
#include "protocol/wire/codec.h"

namespace focalfleet {

class UnitSessions {
 public:
  /// The parts that `fleet` refers to outlive this.
  explicit UnitSessions(const Coordination& fleet) : fleet_(fleet) {}

  /// The unit's timer ran out: repeats the open question, gives it up, or asks what the unit's
  /// phase asks for. Nothing happens in a phase of an upload without an open question: the
  /// executor acts there.
  void Service(PositionerIndex i);

  /// Takes one valid frame of a unit on its own bus, that had ended at `at`.
  void Hear(PositionerIndex i, const Addressed<UnitMessage>& heard, HostInstant at);

  void LinkChanged(const LinkEvent& event);

  void Enable(const EnableCommand& command);

 private:
  const Coordination fleet_;
};

}  // namespace focalfleet
