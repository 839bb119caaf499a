// A refused row is one that the store can never keep. A unit must not move while the store does not
// hold its place, intent or binding: after a restart its place would not be known. Nothing but a
// fault of this program, or of the file, leads here, so an operator decides when it is tried again.
#pragma once

#include "fleet/coordinate/coordination.h"

namespace focalfleet {

/// The store set a row aside. Where the row holds a unit's place or binding, that unit is not moved
/// until an operator enables it again. A command that waits for the row is answered with the
/// reason.
void StoreRefused(const Coordination& fleet, const RefusedRow& refused);

}  // namespace focalfleet
