#include "fleet/coordinate/intents.h"

#include <optional>

#include "fleet/coordinate/unit_knowledge.h"
#include "fleet/kinematics.h"

namespace focalfleet {

Pose HomeCountOf(const Coordination& fleet, PositionerIndex i) {
  const Unit& unit = fleet.layout.unit(i);
  const UnitDrive& drive = fleet.drive(i);
  constexpr std::size_t kTheta = Index(Axis::kTheta), kPhi = Index(Axis::kPhi);
  return {NearestVectors(unit.axis[kTheta].min_deg, unit.axis[kTheta], drive.axis[kTheta]),
          NearestVectors(unit.axis[kPhi].max_deg, unit.axis[kPhi], drive.axis[kPhi])};
}

IntentRow IntentOf(const Coordination& fleet, const Round& round, std::uint64_t configuration,
                   PositionerIndex i) {
  const UnitPlan& plan = *round.PlanOf(i);
  IntentRow row{.configuration = configuration,
                .serial = fleet.units[i].view.serial,
                .unit = fleet.layout.unit(i).id,
                .move = round.MoveOf(i),
                .from = plan.from,
                .to = plan.to,
                .hull = {}};
  for (const Axis axis : kAxes) {
    const Span span = SpanOf(plan.from[Index(axis)], plan.path[Index(axis)]);
    row.hull[Index(axis)] = {Witness::kInterval, span.low, span.high};
  }
  return row;
}

void Intend(const Coordination& fleet, const IntentRow& intent, const Pose& offset,
            PositionerIndex i, Round* round) {
  UnitView& view = fleet.units[i].view;
  (*round)[i].before = {view.knowledge, view.offset, intent.move};
  view.offset = offset;
  fleet.units[i].motion.ended_early = false;
  fleet.ledger.intents[intent.serial] = intent;
  fleet.ledger.Note(intent);
  // The store must not claim the old place any more: the unit may be anywhere on its way.
  Know(fleet, i, intent.hull, Origin::kMove);
}

void TakeBackIntent(const Coordination& fleet, PositionerIndex i, Round* round) {
  std::optional<RoundUnit::Before>& before = (*round)[i].before;
  if (!before) return;
  // A unit that was lost meanwhile keeps its intent: its return decides, or has decided.
  UnitView& view = fleet.units[i].view;
  const auto intent = fleet.ledger.intents.find(view.serial);
  const bool open = intent != fleet.ledger.intents.end() && intent->second.move == before->move;
  if (open && (view.phase == UnitPhase::kArmed || view.phase == UnitPhase::kReady ||
               view.phase == UnitPhase::kHoming)) {
    fleet.ledger.EndIntent(view.serial, IntentEnd::kNeverBegan);
    view.offset = before->offset;
    Know(fleet, i, before->knowledge, Origin::kMove);
  }
  before.reset();
}

void TakeBackIntents(const Coordination& fleet, Round* round) {
  for (std::uint32_t n = 0; n < fleet.units.size(); ++n) TakeBackIntent(fleet, {n}, round);
}

}  // namespace focalfleet
