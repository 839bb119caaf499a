// A unit of unknown place that was found gets its own count set to where it stands.
//
// The unit takes the count nearest to the written one that shows the vector now applied, because
// rotor and field agree at rest (docs/protocol.md, Power). Only whole motor turns change,
// therefore. The rest, at most half a motor turn, is the offset of its place from its count. An
// interrupted unit takes moves again once both counts are written.
#pragma once

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// Begins to set the count of a unit of unknown place, to the vector that it shows
/// (UnitRecord::locating until that is over). The unit does not move. Its place is known,
/// `measured`, when both axes have taken it; else it stays unknown, with an alarm. Pre: kReady.
void Locate(const Coordination& fleet, PositionerIndex i, const Pose& place);
/// Writes the count of the next axis. Pre: UnitRecord::locating.
void WriteCount(const Coordination& fleet, PositionerIndex i);
/// Pre: UnitRecord::locating.
void OnCountWritten(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply);

}  // namespace focalfleet
