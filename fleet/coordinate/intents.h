// An intent says that a unit is about to move, from where, to where, and within which hull. Nothing
// starts before its intent is durable: after a restart the store then holds where the unit may be.
#pragma once

#include <cstdint>

#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/round.h"
#include "fleet/records.h"

namespace focalfleet {

/// The counts of a unit that has homed: the stop of each axis.
[[nodiscard]] Pose HomeCountOf(const Coordination& fleet, PositionerIndex i);
/// The intent of the unit's move in this round. Pre: it has one.
[[nodiscard]] IntentRow IntentOf(const Coordination& fleet, const Round& round,
                                 std::uint64_t configuration, PositionerIndex i);
/// Notes the intent. `offset` is that of the unit's count from here on.
void Intend(const Coordination& fleet, const IntentRow& intent, const Pose& offset,
            PositionerIndex i, Round* round);
/// Ends an intent that has not begun, and restores what was known before it. No effect without one.
void TakeBackIntent(const Coordination& fleet, PositionerIndex i, Round* round);
void TakeBackIntents(const Coordination& fleet, Round* round);

}  // namespace focalfleet
