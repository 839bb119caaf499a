// A unit with sensors of its own is asked for their readings part by part, with one question open
// at a time. Where the unit sends no readings, or another part than was asked, the reading is given
// up with an alarm. The unit is not lost then: the next poll shows whether it answers at all.
#pragma once

#include <string>

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// Begins to read the sensors of a unit that rests and has some: UnitRecord::sensing.
void Sense(const Coordination& fleet, PositionerIndex i);
/// Asks for the next part. Pre: UnitRecord::sensing is under way.
void AskSensors(const Coordination& fleet, PositionerIndex i);
void OnSensors(const Coordination& fleet, PositionerIndex i, const SensorsReply& reply);
/// Gives the reading up, with an alarm that says `what`.
void SensorsDoNotAnswer(const Coordination& fleet, PositionerIndex i, const std::string& what);

}  // namespace focalfleet
