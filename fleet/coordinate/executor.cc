#include "fleet/coordinate/executor.h"

#include <algorithm>

#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/round_events.h"
#include "fleet/coordinate/unit_knowledge.h"
#include "fleet/coordinate/watch.h"

namespace focalfleet {

// ---- commands

/// `source` is shown in parentheses; empty: not shown.
Status ConfigurationExecutor::MayBegin(const std::string& source) const {
  if (!busy()) return {};
  return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view().id) +
                                       (source.empty() ? "" : " (" + source + ")") +
                                       " is under way: stop it or wait until it ends");
}

Status ConfigurationExecutor::Apply(std::uint64_t request, const ApplyCommand& command) {
  FOCALFLEET_TRY(MayBegin(view().source));
  FOCALFLEET_TRY_ASSIGN(const Goal goal, GoalOf(fleet_, command));
  progress_.Begin(request, goal);
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) SetTarget({n}, goal);
  rooms_.configuration.Record();
  return {};
}

Result<Preview> ConfigurationExecutor::PreviewOf(const ApplyCommand& command) const {
  FOCALFLEET_TRY(MayBegin(view().source));
  FOCALFLEET_TRY_ASSIGN(const Goal goal, GoalOf(fleet_, command));
  return focalfleet::PreviewOf(fleet_, goal, rooms_.round.next_skew_s);
}

/// Settles what can be said of the unit's target before it moves.
void ConfigurationExecutor::SetTarget(PositionerIndex i, const Goal& goal) {
  Configuration& configuration = rooms_.configuration;
  ConfigurationUnit& unit = configuration[i];
  const UnitView& view = fleet_.units[i].view;
  const auto& measure = goal.measure;
  if (unit.target) {
    ++configuration.view.counts.targeted;
    configuration.outcomes.Set(i, TargetOutcome::kPending);
    if (!view.enabled)
      configuration.outcomes.Set(i, TargetOutcome::kRefused, "disabled: " + view.disabled_reason);
    // A unit of a configuration that is only observed comes as its count has it.
    const bool expects = !goal.offsets.empty() && goal.offsets[i.value] && view.enabled &&
                         view.phase == UnitPhase::kReady && IsPlace(view.knowledge) &&
                         !(measure && measure->observe);
    if (expects) Expect(fleet_, i, *goal.offsets[i.value]);
    const bool in_reach = fleet_.units.NearestInReach(i, *unit.target) == *unit.target;
    if (!in_reach && !measure)
      configuration.outcomes.Set(i, TargetOutcome::kRefused,
                                 "its range, as it was measured, ends before it");
    if (measure) unit.target = rooms_.corrections.GoalFor(i, *unit.target);
  }
  unit.goal = unit.target;
}

Status ConfigurationExecutor::Home(std::uint64_t request, const HomeCommand& command) {
  FOCALFLEET_TRY(MayBegin({}));
  FOCALFLEET_TRY_ASSIGN(const Goal goal, GoalOf(fleet_, command));
  progress_.Begin(request, goal);
  if (goal.unproven && !goal.to_home.empty())
    fleet_.ledger.alarms().Raise(
        AlarmName::kHomingUnproven, {}, {},
        "homing of " + std::to_string(command.units.size()) +
            " units without proof that their neighbours are out of the way, as commanded");
  rooms_.configuration.view.counts.targeted = static_cast<std::uint32_t>(goal.to_home.size());
  for (const PositionerIndex i : goal.to_home)
    rooms_.configuration.outcomes.Set(i, TargetOutcome::kPending);
  rooms_.configuration.Record();
  return {};
}

Status ConfigurationExecutor::Measure(std::uint64_t request) {
  FOCALFLEET_TRY(MayBegin({}));
  FOCALFLEET_TRY_ASSIGN(const Goal goal, GoalOf(fleet_, MeasureCommand{}));
  progress_.Begin(request, goal);
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) {
    if (!fleet_.units[{n}].view.enabled) continue;
    ++rooms_.configuration.view.counts.targeted;
    rooms_.configuration.outcomes.Set({n}, TargetOutcome::kPending);
  }
  rooms_.configuration.Record();
  return {};
}

Status ConfigurationExecutor::Retarget(std::uint64_t request, const RetargetCommand& command) {
  FOCALFLEET_TRY(rooms_.late.MayRetarget(command));
  const PositionerIndex i = command.unit;
  const std::string name = fleet_.units.NameOf(i);
  rooms_.configuration.Retarget(i, command.target);
  rooms_.corrections.Forget(i);
  fleet_.ledger.alarms().Raise(AlarmName::kUnitRetargeted, i, {}, name + " gets another target");
  if (rooms_.round.part(i) == Part::kMoving) {
    StopFollowers(fleet_, rooms_.round, i,
                  {fleet_.now(), fleet_.now() + fleet_.requests.Patience()},
                  name + " gets another target and may stand in its way");
    StopOne(fleet_, i, "it gets another target");
  }
  rooms_.late.Add(i, request);
  fleet_.out().replies.push_back({request, false, {}, name + " gets another target"});
  return {};
}

// ---- stops

void ConfigurationExecutor::StopAll(const std::string& reason) {
  for (std::size_t bus = 0; bus < fleet_.units.buses.size(); ++bus)
    fleet_.requests.SendNow(bus, Stop{}, kBroadcastNode);
  if (busy()) progress_.Stop(reason);
}

void ConfigurationExecutor::StopUnit(PositionerIndex i) {
  const std::string name = fleet_.units.NameOf(i);
  rooms_.configuration.outcomes.Set(i, TargetOutcome::kStopped, "stopped by the operator");
  if (busy()) rooms_.configuration[i].excluded = true;
  // A unit that gives its late move back may be asked to stop already.
  if (rooms_.late.Stop(i, " was stopped by the operator") && fleet_.units[i].request.question)
    return;
  if (!IsUnderWay(fleet_.units[i].view.phase)) {
    fleet_.requests.SendNow(fleet_.units[i].bus, Stop{}, fleet_.layout.unit(i).node);
    return;
  }
  StopFollowers(fleet_, rooms_.round, i, {fleet_.now(), fleet_.now() + fleet_.requests.Patience()},
                name + " was stopped and may stand in its way");
  StopOne(fleet_, i, "by the operator");
}

// The reason of the other host is not known here: nothing moves until an operator says so. A stop
// of one bus or unit becomes one of all, because the others were to pass where it stands now.
void ConfigurationExecutor::StoppedByAnotherHost(PositionerIndex i) {
  const Configuration& configuration = rooms_.configuration;
  if (!busy() || configuration.stopping || configuration.phase() == ConfigurationPhase::kReporting)
    return;
  fleet_.ledger.alarms().Raise(
      AlarmName::kStoppedByOther, i, {},
      fleet_.units.NameOf(i) + " was stopped on the bus by somebody else: configuration " +
          std::to_string(view().id) + " ends, nothing moves until an operator applies again");
  StopAll("stopped on the bus by somebody else");
}

void ConfigurationExecutor::GiveUp() {
  if (!busy()) return;
  rooms_.configuration.view.state = ConfigurationState::kFailed;
  fleet_.ledger.alarms().Raise(AlarmName::kConfigurationCutShort, {}, {}, DaemonEnded(view().id));
  rooms_.configuration.Record();
}

// ---- answers

void ConfigurationExecutor::OnConfirm(PositionerIndex i, const ConfirmReply& reply) {
  if (const auto refusal = rooms_.upload.OnConfirm(i, reply)) FailBeforeStart(i, *refusal, &rooms_);
}

void ConfigurationExecutor::OnArm(PositionerIndex i, const ArmReply& reply) {
  if (const auto refusal = rooms_.upload.OnArm(i, reply)) FailBeforeStart(i, *refusal, &rooms_);
}

void ConfigurationExecutor::OnProgress(PositionerIndex i, const ProgressReply& reply) {
  if (const auto refusal = rooms_.upload.OnProgress(i, reply))
    FailBeforeStart(i, *refusal, &rooms_);
}

void ConfigurationExecutor::OnHomeReply(PositionerIndex i, const HomeReply& reply) {
  if (rooms_.homing.Refuses(i, reply)) Identify(fleet_, i);
}

void ConfigurationExecutor::Advance() {
  std::vector<UnitEvent>& events = fleet_.units.events;
  for (std::size_t n = 0; n < events.size(); ++n) {
    const UnitEvent event = events[n];  // taking it may report more
    if (event.kind == UnitEventKind::kForeignStop)
      StoppedByAnotherHost(event.unit);
    else
      TakeEvent(event, &rooms_);
  }
  events.clear();
  progress_.Advance();
}

HostInstant ConfigurationExecutor::due() const {
  return std::min(rooms_.configuration.due, rooms_.late.due());
}

}  // namespace focalfleet
