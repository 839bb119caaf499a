#include "fleet/coordinate/reconcile.h"

namespace focalfleet {
namespace {

constexpr UnitKnowledge kUnknownPlace{};

Reconciled Unknown(const char* reason, std::optional<IntentEnd> end = {}) {
  return {kUnknownPlace, end, reason};
}

Reconciled AfterIntent(const UnitSays& unit, const IntentRow& intent, bool homes) {
  const bool began = unit.status.move == intent.move;
  if (unit.status.interrupted) {
    if (!began)
      return Unknown("power was lost in a move that is not on record", IntentEnd::kNeverBegan);
    return {InterruptedHull(intent, unit.subdivision), IntentEnd::kInterrupted,
            "power was lost in mid-move"};
  }
  // FLASH gets the final vectors at the end of a motion. A unit that began, restarted and does not
  // count as at its end may have lost its mark together with its power, and its count with it: it
  // stands anywhere on its way. Without a restart it was stopped, before its first step or later.
  if (began && unit.status.restarted &&
      (unit.position == intent.from || unit.position != intent.to))
    return {InterruptedHull(intent, unit.subdivision), IntentEnd::kInterrupted,
            unit.position == intent.from
                ? "it counts from where its last move began, though it began"
                : "it restarted, and does not count as at the end of its last move"};
  // The rotor may have met its stop and slipped while the vectors went on, and where homing began
  // was not known, as a rule.
  if (began && homes && unit.position != intent.to)
    return {InterruptedHull(intent, unit.subdivision), IntentEnd::kStopped,
            "its homing was cut short"};
  if (began)
    return {Exactly(Witness::kReported, unit.position),
            unit.position == intent.to ? IntentEnd::kArrived : IntentEnd::kStopped};
  if (unit.position == intent.from)
    return {Exactly(Witness::kReported, unit.position), IntentEnd::kNeverBegan};
  return Unknown("its stored vectors differ from where its last move was to begin",
                 IntentEnd::kNeverBegan);
}

}  // namespace

UnitKnowledge InterruptedHull(const IntentRow& intent,
                              const std::array<std::uint16_t, kAxisCount>& subdivision) {
  UnitKnowledge hull = intent.hull;
  for (const Axis axis : kAxes) {
    hull[Index(axis)].witness = Witness::kInterval;
    hull[Index(axis)].low -= subdivision[Index(axis)] / 2;
    hull[Index(axis)].high += subdivision[Index(axis)] / 2;
  }
  return hull;
}

Reconciled Reconcile(const UnitSays& unit, const StoreSays& store) {
  if (store.intent && store.vector && unit.subdivision != store.vector->subdivision)
    return Unknown("its subdivision differs from the stored one", IntentEnd::kInterrupted);
  if (store.intent) return AfterIntent(unit, *store.intent, store.homes);
  if (!store.vector) {
    if (unit.status.interrupted) return Unknown("power was lost in a move that is not on record");
    return {Exactly(Witness::kReported, unit.position), {}};
  }
  const UnitKnowledge& stored = store.vector->knowledge;
  if (!IsPlace(stored))  // neither waiting nor a restart makes an interval narrower
    return {stored, {}, "its last move was cut short and it has not been homed since"};
  if (unit.status.interrupted) return Unknown("power was lost in a move that is not on record");
  if (unit.subdivision != store.vector->subdivision)
    return Unknown("its subdivision differs from the stored one");
  if (unit.position != PlaceOf(stored))
    return Unknown("its stored vectors differ from the coordinator's");
  return {stored, {}};
}

}  // namespace focalfleet
