// Every change of what is known of a unit's place goes through these functions. The change is kept
// in the unit's view and noted for the store at once, so the two never differ.
#pragma once

#include "fleet/coordinate/coordination.h"
#include "fleet/knowledge.h"
#include "fleet/measurement.h"

namespace focalfleet {

/// The unit is settled now, and `knowledge` is kept in its view and in the store.
void Know(const Coordination& fleet, PositionerIndex i, const UnitKnowledge& knowledge,
          Origin origin);
/// The camera or its own sensors found the unit at `place`, where its count had it elsewhere. The
/// count is right from here on, but for the offset. Pre: the unit stands at one known place.
void See(const Coordination& fleet, PositionerIndex i, const Pose& place, MeasurementSource source);
/// A model predicts that the unit's place exceeds its count by `offset`. Pre: as See.
void Expect(const Coordination& fleet, PositionerIndex i, const Pose& offset);

}  // namespace focalfleet
