// Upkeep of the model in force. The model is restored at the start and learns where each unit
// rests. The model loses each unit that is no longer what the model was measured on.
#pragma once

#include "daemon/status/status_snapshot.h"
#include "daemon/store/store_reader.h"
#include "daemon/verbs/model_registry.h"
#include "fleet/coordinator.h"

namespace focalfleet {

/// The registry knows the newest kChangesMax changes of the store. Errors: those of the store.
Status TakeModelChanges(StoreReader* reader, ModelRegistry* models);

/// The model that was in force when the last daemon ended is in force again. Errors: those of the
/// store; kInvalid: the model no longer belongs to this fleet. Then none is in force.
Status RestoreModel(StoreReader* reader, ModelRegistry* models);

/// Units that are no longer what the model in force was measured on go without it: their count
/// began anew, or other hardware stands there. Errors: those of the store.
Status ForgetStrangers(StoreReader* reader, ModelRegistry* models);

/// The model learns what the unit counts, if it rests. Pre: `compensation` is given.
void NoteRest(const FleetView& view, PositionerIndex i, Compensation* compensation);
/// The same for all units. Nothing happens where no model is in force.
void NoteRests(const FleetView& view, Compensation* compensation);
/// The model has lost units whose count began anew or whose hardware was replaced, and has learnt
/// the rests of units that changed, by the effects of one step. Nothing happens where no model is
/// in force.
void NoteEffects(const FleetView& view, const Effects& effects, Compensation* compensation);

}  // namespace focalfleet
