#include "daemon/verbs/model_upkeep.h"

#include <string>
#include <utility>
#include <variant>

#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

AxisAngles CountOf(const FleetView& view, PositionerIndex i, const Pose& place) {
  const Pose& offset = view.coordinator->unit(i).offset;
  return AnglesOf(view.layout->unit(i), view.coordinator->drives()[i.value],
                  {place[0] - offset[0], place[1] - offset[1]});
}

}  // namespace

Status TakeModelChanges(StoreReader* reader, ModelRegistry* models) {
  FOCALFLEET_TRY_ASSIGN(auto changes, reader->Models(ModelRegistry::kChangesMax));
  models->TakeChanges(std::move(changes));
  return {};
}

Status RestoreModel(StoreReader* reader, ModelRegistry* models) {
  FOCALFLEET_TRY(TakeModelChanges(reader, models));
  if (models->newest_sha256().empty()) return {};
  FOCALFLEET_TRY_ASSIGN(const std::string text, reader->ModelText(models->newest_sha256()));
  FOCALFLEET_TRY(models->Restore(text));
  return ForgetStrangers(reader, models);
}

Status ForgetStrangers(StoreReader* reader, ModelRegistry* models) {
  Compensation* const model = models->compensation();
  if (model == nullptr) return {};
  FOCALFLEET_TRY_ASSIGN(const auto counted_anew, reader->CountedAnewSince(models->since()));
  for (const UnitId id : counted_anew)
    if (const auto i = models->layout().Find(id)) model->Forget(*i);
  FOCALFLEET_TRY_ASSIGN(const auto bindings, reader->Bindings());
  for (const auto& [id, serial] : bindings) {
    const auto i = models->layout().Find(id);
    if (i && model->serial(*i).value != 0 && model->serial(*i) != serial) model->Forget(*i);
  }
  return {};
}

void NoteRest(const FleetView& view, PositionerIndex i, Compensation* compensation) {
  const UnitView& unit = view.coordinator->unit(i);
  if (unit.phase != UnitPhase::kReady || !IsPlace(unit.knowledge)) return;
  compensation->Rests(i, CountOf(view, i, PlaceOf(unit.knowledge)));
}

void NoteRests(const FleetView& view, Compensation* compensation) {
  if (compensation == nullptr) return;
  for (std::uint32_t n = 0; n < view.layout->size(); ++n) NoteRest(view, {n}, compensation);
}

// A model predicts from how a unit came to where it rests. A count that began anew, or other
// hardware, is not what the model was measured on.
void NoteEffects(const FleetView& view, const Effects& effects, Compensation* compensation) {
  if (compensation == nullptr) return;
  const auto forget = [&](SerialNumber serial) {
    for (const PositionerIndex i : effects.changed)
      if (view.coordinator->unit(i).serial == serial) compensation->Forget(i);
  };
  for (const Row& row : effects.rows) {
    if (const auto* end = std::get_if<IntentEndRow>(&row); end && end->end == IntentEnd::kHomed)
      forget(end->serial);
    if (const auto* vector = std::get_if<VectorRow>(&row);
        vector && (vector->origin == Origin::kOperator || vector->origin == Origin::kFound))
      forget(vector->serial);
    if (const auto* binding = std::get_if<BindingRow>(&row);
        binding && binding->replaced.value != 0)
      if (const auto i = view.layout->Find(binding->unit)) compensation->Forget(*i);
  }
  for (const PositionerIndex i : effects.changed) NoteRest(view, i, compensation);
}

}  // namespace focalfleet
