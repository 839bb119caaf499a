#include "fleet/coordinate/round_events.h"

#include <algorithm>

#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/watch.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

void NoteWhetherEarly(PositionerIndex i, ExecutorRooms* rooms) {
  const auto course = rooms->round.CourseOf(i);
  rooms->round[i].ended_early = course && !MayHaveArrived(rooms->fleet, rooms->round, *course);
}

/// The motion of the unit has ended, and its place is settled as far as it can be.
void EndMotion(PositionerIndex i, UnitEventKind how, ExecutorRooms* rooms) {
  const Coordination& fleet = rooms->fleet;
  Configuration& configuration = rooms->configuration;
  Round& round = rooms->round;
  const UnitView& view = fleet.units[i].view;
  NoteWhetherEarly(i, rooms);
  round.last_arrival = std::max(round.last_arrival, fleet.now());
  round.settled_batch = fleet.ledger.batch_now();
  configuration[i].ended = fleet.now();
  const std::optional<Pose> place =
      IsPlace(view.knowledge) ? std::optional(PlaceOf(view.knowledge)) : std::nullopt;
  const bool homed = configuration.phase() == ConfigurationPhase::kHoming &&
                     how == UnitEventKind::kReady && place.has_value();
  if (homed) rooms->homing.NoteHomed(i);
  const std::optional<Pose>& target = configuration[i].target;
  if (view.outcome == TargetOutcome::kPending && place && !rooms->corrections.Waits(i) &&
      (homed || (target && *place == *target)))
    configuration.outcomes.NoteArrival(i, fleet.ledger.batch_now());
  // `reached` is about the end of the plan, not the target. A unit that only makes way has no
  // target, and others may come to theirs by stages.
  const UnitPlan* const plan = round.PlanOf(i);
  const bool reached = plan != nullptr && !round.IsLate(i) && place && *place == plan->to;
  rooms->corrections.NoteDirections(i, reached ? plan : nullptr);
  if (plan != nullptr && PlaceOf(view.knowledge) != plan->to && !configuration.stopping)
    StopFollowers(fleet, round, i, SeenUntil(fleet, i, fleet.now()),
                  fleet.units.NameOf(i) + " did not get out of its way");
}

void Settle(PositionerIndex i, UnitEventKind how, ExecutorRooms* rooms) {
  const bool moved = rooms->round.part(i) == Part::kMoving;
  if (moved) EndMotion(i, how, rooms);
  rooms->upload.Leave(i);
  // A unit that ends past its target is not there yet, and stays.
  if (moved && !rooms->corrections.goes_past()) rooms->late.GoOn(i);
}

void Lose(PositionerIndex i, const std::string& reason, ExecutorRooms* rooms) {
  const Coordination& fleet = rooms->fleet;
  const UnitPhase phase = fleet.units[i].view.phase;
  rooms->configuration.outcomes.Set(
      i, TargetOutcome::kFailed,
      phase == kFault ? "it " + fleet.units.TroubleOf(i) : "it " + reason);
  rooms->configuration[i].excluded = true;
  // A silent unit may move on, and end later.
  if (rooms->round.part(i) == Part::kMoving) {
    NoteWhetherEarly(i, rooms);
    StopFollowers(fleet, rooms->round, i,
                  SeenUntil(fleet, i, phase == kSilent ? kNever : fleet.now()),
                  fleet.units.NameOf(i) + " may stand in its way");
  }
  rooms->upload.Leave(i);
}

}  // namespace

void TakeEvent(const UnitEvent& event, ExecutorRooms* rooms) {
  const PositionerIndex i = event.unit;
  const Coordination& fleet = rooms->fleet;
  Round& round = rooms->round;
  if (event.kind == UnitEventKind::kStartReported) {
    ConfigurationView& view = rooms->configuration.view;
    rooms->start.NoteStart(i, view.round, &view.starts);
    return;
  }
  if (round.part(i) == Part::kNone) return;
  switch (event.kind) {
    case UnitEventKind::kReady:
    case UnitEventKind::kStopped:
      Settle(i, event.kind, rooms);
      break;
    case UnitEventKind::kNeverBegan:
      rooms->configuration.Strike(i, "does not begin to move");
      StopFollowers(fleet, round, i, {HostInstant{INT64_MIN}, fleet.now()},
                    fleet.units.NameOf(i) + " stands in its way");
      break;  // settled when it has been read again
    case UnitEventKind::kUnheard:
      // Until the unit is heard, or given up, it may also end still.
      if (round.part(i) == Part::kMoving)
        StopFollowers(fleet, round, i, SeenUntil(fleet, i, fleet.now() + fleet.requests.Patience()),
                      fleet.units.NameOf(i) + " is not heard and may stand in its way");
      break;
    case UnitEventKind::kEnded:
      // A unit whose time is over has arrived, most likely; its FLASH holds its place.
      if (const auto course = round.CourseOf(i); course && !MayHaveArrived(fleet, round, *course))
        StopFollowers(fleet, round, i, SeenUntil(fleet, i, fleet.now()),
                      fleet.units.NameOf(i) + " stands in its way");
      break;
    case UnitEventKind::kLost:
      Lose(i, event.reason, rooms);
      break;
    case UnitEventKind::kForeignStop:
    case UnitEventKind::kStartReported:
      break;  // above
  }
}

void FailBeforeStart(PositionerIndex i, const std::string& reason, ExecutorRooms* rooms) {
  const Coordination& fleet = rooms->fleet;
  fleet.requests.Forget(i);
  rooms->configuration.Strike(i, reason);
  fleet.ledger.alarms().Raise(AlarmName::kUnitRefused, i, {}, fleet.units.NameOf(i) + " " + reason);
  rooms->upload.Leave(i);
  // A move that the unit holds is taken back by reading it anew.
  Identify(fleet, i);
}

}  // namespace focalfleet
