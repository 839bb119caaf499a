// ConfigurationExecutor, from the intent to rest: start, homing, and every kind of stop.

#include <algorithm>
#include <utility>

#include "fleet/coordinate/executor.h"
#include "fleet/coordinate/stall_detection.h"
#include "fleet/estimate.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

constexpr int kStartRepeats = 2;

}  // namespace

// ---- moving

IntentRow ConfigurationExecutor::IntentOf(PositionerIndex i) const {
  const UnitPlan& plan = plan_.moves[plan_of_[i.value]];
  IntentRow row{.configuration = view_.id,
                .serial = core_.units[i.value].view.serial,
                .unit = core_.layout.unit(i).id,
                .move = MoveOf(i),
                .from = plan.from,
                .to = plan.to,
                .hull = {}};
  for (const Axis axis : kAxes) {
    const Span span = SpanOf(plan.from[Index(axis)], plan.path[Index(axis)]);
    row.hull[Index(axis)] = {Witness::kInterval, span.low, span.high};
  }
  return row;
}

// `offset` is that of the unit's count from here on.
void ConfigurationExecutor::Intend(PositionerIndex i, const IntentRow& intent, const Pose& offset) {
  UnitView& view = core_.unit(i).view;
  before_[i.value] = {view.knowledge, view.offset};
  view.offset = offset;
  core_.intents[intent.serial] = intent;
  core_.Note(intent);
  // From here on the store must not claim the old place: the unit may be anywhere on its way.
  core_.Know(i, intent.hull, Origin::kMove);
}

void ConfigurationExecutor::TakeBackIntent(PositionerIndex i) {
  std::optional<Before>& before = before_[i.value];
  if (!before) return;
  // Who was lost meanwhile keeps its intent: its return decides.
  if (core_.unit(i).view.phase == kArmed || core_.unit(i).view.phase == kReady) {
    core_.EndIntent(i, IntentEnd::kNeverBegan);
    core_.unit(i).view.offset = before->offset;
    core_.Know(i, before->knowledge, Origin::kMove);
  }
  before.reset();
}

void ConfigurationExecutor::TakeBackIntents() {
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) TakeBackIntent({n});
}

void ConfigurationExecutor::CommitRound() {
  for (const UnitPlan& move : plan_.moves) {
    Intend(move.unit, IntentOf(move.unit), core_.unit(move.unit).view.offset);
  }
  commit_batch_ = core_.batch_now();
  SetState(State::kCommitting);
}

void ConfigurationExecutor::Start() {
  view_.state = ConfigurationState::kMoving;
  CountPrediction();
  Record();
  view_.started = core_.now + core_.config.start_delay;
  last_arrival_ = view_.started;
  start_repeats_ = 0;
  for (const UnitPlan& move : plan_.moves) {
    UnitRecord& unit = core_.unit(move.unit);
    SetPart(move.unit, Part::kMoving);
    core_.SetPhase(move.unit, kMoving);
    before_[move.unit.value].reset();
    unit.view.error_um.reset();  // nobody has seen it where it goes now
    unit.seen_moving = HostInstant{INT64_MIN};
    WatchLeader(move.unit);
    core_.SetDue(move.unit, unit.next_poll);
  }
  ExpectStarts();
  if (core_.config.sync_line) core_.out->sync_at = view_.started;
  SetState(State::kMoving);
  RepeatStart();
}

void ConfigurationExecutor::RepeatStart() {
  DurationNs left = view_.started - core_.now;
  if (core_.config.sync_line) left = left + core_.config.sync_lead;
  const auto ticks = static_cast<std::uint32_t>(std::max<std::int64_t>(left.ns, 0) / kTick.ns);
  std::vector<bool> reported(core_.buses.size());
  for (const UnitPlan& move : plan_.moves) {
    const std::size_t bus = core_.unit(move.unit).bus;
    if (reported[bus]) continue;
    reported[bus] = true;
    core_.SendNow(bus, focalfleet::Start{move_, ticks}, kBroadcastNode);
  }
  start_repeat_ = ++start_repeats_ > kStartRepeats
                      ? kNever
                      : core_.now + DurationNs{core_.config.start_delay.ns / (kStartRepeats + 2)};
  due_ = start_repeat_;
}

// When others pass where it may stand.
void ConfigurationExecutor::SetWatch(PositionerIndex i) {
  UnitRecord& unit = core_.unit(i);
  unit.watch_from = kNever;
  unit.watch_until = HostInstant{INT64_MIN};
  for (const auto& follower : plan_.moves[plan_of_[i.value]].followers) {
    unit.watch_from = std::min(unit.watch_from, AtPlanTime(follower.since_s));
    unit.watch_until = std::max(unit.watch_until, AtPlanTime(follower.left_s));
  }
}

// When a unit that starts is asked first.
void ConfigurationExecutor::WatchLeader(PositionerIndex i) {
  constexpr DurationNs kBegun = Milliseconds(50);  // everybody has, whatever the skew
  SetWatch(i);
  UnitRecord& unit = core_.unit(i);
  // Spread over a period, so that a bus never hears all its units at once.
  const auto spread = [&](DurationNs period) {
    return DurationNs{period.ns * (i.value % 97) / 97};
  };
  const HostInstant began = BeganOf(i);
  const DurationNs poll = core_.config.poll_period;
  const DurationNs watch = StallDetectionOf(core_.config).poll;
  unit.begun_by = began + poll;
  unit.next_poll = began + poll + spread(poll);
  if (unit.watch_from < unit.watch_until)
    unit.next_poll = std::min(unit.next_poll,
                              std::max(began + kBegun, unit.watch_from) + spread(watch - kBegun));
}

// One that moves already has got one more follower.
void ConfigurationExecutor::WatchSoon(PositionerIndex i) {
  SetWatch(i);
  UnitRecord& unit = core_.unit(i);
  unit.next_poll = std::min(unit.next_poll, std::max(core_.now, unit.watch_from));
  if (!unit.question) core_.SetDue(i, unit.next_poll);
}

std::optional<ConfigurationExecutor::Course> ConfigurationExecutor::CourseOf(
    PositionerIndex i) const {
  if (part_[i.value] != Part::kMoving || plan_of_[i.value] == kNoPlan) return std::nullopt;
  return Course{&plan_.moves[plan_of_[i.value]], BeganOf(i)};
}

bool ConfigurationExecutor::MayHaveArrived(const Course& course) const {
  const PlanOptions allowed;
  const double end_s = EndOf(*course.plan, core_.drives[course.plan->unit.value]);
  return core_.now >= course.began + Seconds(end_s * (1 - allowed.clock_error) - 2 * round_skew_s_);
}

ConfigurationExecutor::Ended ConfigurationExecutor::SeenUntil(PositionerIndex i,
                                                              HostInstant until) const {
  return {core_.units[i.value].seen_moving, until};
}

// Those that come where it may stand. Who passes only where it has been already, or will not have
// come yet, goes on.
void ConfigurationExecutor::StopFollowers(PositionerIndex first, const Ended& ended,
                                          const std::string& reason) {
  std::vector<std::pair<PositionerIndex, Ended>> open{{first, ended}};
  while (!open.empty()) {
    const auto [i, when] = open.back();
    open.pop_back();
    if (plan_of_[i.value] == kNoPlan) continue;
    for (const auto& follower : plan_.moves[plan_of_[i.value]].followers) {
      if (AtPlanTime(follower.left_s) < when.from || AtPlanTime(follower.since_s) > when.until)
        continue;
      UnitRecord& unit = core_.unit(follower.unit);
      const bool asked = unit.question && std::holds_alternative<Stop>(unit.question->message);
      if (part_[follower.unit.value] != Part::kMoving || unit.view.phase != kMoving || asked)
        continue;
      StopOne(follower.unit, reason);
      // It ends when the stop gets through; should that take longer, it is looked at anew then.
      open.push_back({follower.unit, {core_.now, core_.now + core_.Patience()}});
    }
  }
}

// ---- homing

IntentRow ConfigurationExecutor::HomingIntentOf(PositionerIndex i) const {
  const UnitView& view = core_.units[i.value].view;
  const Unit& unit = core_.layout.unit(i);
  IntentRow row{.configuration = view_.id,
                .serial = view.serial,
                .unit = unit.id,
                .move = move_,
                .from = {},
                .to = {},
                .hull = {}};
  for (const Axis axis : kAxes) {
    const AxisGeometry& geometry = unit.axis[Index(axis)];
    const AxisDrive& drive = core_.drives[i.value].axis[Index(axis)];
    const std::int32_t low = NearestVectors(geometry.min_deg, geometry, drive);
    const std::int32_t high = NearestVectors(geometry.max_deg, geometry, drive);
    const AxisKnowledge& known = view.knowledge[Index(axis)];
    const bool unknown = known.witness == Witness::kUnknown;
    const std::int32_t to = axis == Axis::kTheta ? low : high;
    row.from[Index(axis)] = unknown ? low : known.low - view.offset[Index(axis)];
    row.to[Index(axis)] = to;
    row.hull[Index(axis)] = {Witness::kInterval, std::min(unknown ? low : known.low, to),
                             std::max(unknown ? high : known.high, to)};
  }
  return row;
}

// As docs/protocol.md has it: phi, then theta, each over its range and some turns more, from
// wherever it stands. To a tenth: how much more is the firmware's own affair.
Plan ConfigurationExecutor::HomingMotion() const {
  constexpr double kOverRange = 1.05;
  constexpr int kTurnsMore = 2;
  Plan plan;
  for (const PositionerIndex i : homing_) {
    const UnitDrive& drive = core_.drives[i.value];
    UnitPlan motion{
        .unit = i, .from = {}, .to = {}, .mode = drive.mode, .path = {}, .followers = {}};
    std::uint32_t start_ticks = 0;
    for (const Axis axis : {Axis::kPhi, Axis::kTheta}) {
      const AxisGeometry& geometry = core_.layout.unit(i).axis[Index(axis)];
      const AxisDrive& tuned = drive.axis[Index(axis)];
      const auto way = static_cast<std::int32_t>(
          NearestVectors(geometry.max_deg - geometry.min_deg, geometry, tuned) * kOverRange +
          kTurnsMore * tuned.subdivision);
      const Segment segment{start_ticks, way, tuned.repeat};
      motion.path[Index(axis)].Append(segment);
      start_ticks = static_cast<std::uint32_t>(TimeOf(segment, tuned).t1_s * 1e9 /
                                               static_cast<double>(kTick.ns));
    }
    plan.moves.push_back(std::move(motion));
  }
  return plan;
}

void ConfigurationExecutor::CommitHoming() {
  std::erase_if(homing_, [&](PositionerIndex i) {
    if (core_.unit(i).view.phase == kReady) return false;
    SetOutcome(i, TargetOutcome::kFailed, "it " + core_.TroubleOf(i));
    std::erase(to_home_, i);
    return true;
  });
  if (homing_.empty()) {
    RoundOver();
    return;
  }
  // A new id: the moves that made way for these units had their own.
  move_ = core_.TakeMoveId();
  for (const PositionerIndex i : homing_) {
    // At its stop it begins to count anew: what the camera found of the old count is over.
    Intend(i, HomingIntentOf(i), {});
  }
  // A few feeds: no work for the planner's thread.
  const PlanEstimate estimate = Estimate(HomingMotion(), core_.layout, core_.drives, MotorModel{});
  prediction_ = {estimate.makespan_s, estimate.energy_J, estimate.peak_power_W};
  commit_batch_ = core_.batch_now();
  SetState(State::kHomeCommitting);
}

void ConfigurationExecutor::StartHoming() {
  view_.state = ConfigurationState::kMoving;
  CountPrediction();
  Record();
  view_.started = core_.now;
  last_arrival_ = core_.now;
  for (const PositionerIndex i : homing_) {
    plan_of_[i.value] = kNoPlan;
    SetPart(i, Part::kMoving);
    core_.SetPhase(i, kHoming);
    before_[i.value].reset();
    core_.unit(i).next_poll = core_.now + core_.config.poll_period;
    core_.Ask(i, focalfleet::Home{move_});
  }
  SetState(State::kHoming);
}

void ConfigurationExecutor::OnHomeReply(PositionerIndex i, const HomeReply& reply) {
  if (core_.unit(i).view.phase != kHoming || reply.move != move_) return;
  core_.SetDue(i, core_.unit(i).next_poll);
  if (reply.answer == Answer::kOk || reply.answer == Answer::kBegunBefore) return;
  SetOutcome(i, TargetOutcome::kFailed, std::string("refuses to home: ") + Name(reply.answer));
  SetPart(i, Part::kNone);
  sessions_.Identify(i);
}

// ---- stopping

// Who stopped it had a reason that is not known here: nothing moves until an operator says so. A
// stop of one bus or unit becomes one of all, because the others were to pass where it stands now.
void ConfigurationExecutor::StoppedBySomebodyElse(PositionerIndex i) {
  if (!busy() || stopping_ || state_ == State::kReporting) return;
  core_.Raise(Severity::kWarning, i, {},
              core_.NameOf(i) + " was stopped on the bus by somebody else: configuration " +
                  std::to_string(view_.id) +
                  " ends, nothing moves until an operator applies again");
  StopAll("stopped on the bus by somebody else");
}

void ConfigurationExecutor::StopAll(const std::string& reason) {
  for (std::size_t bus = 0; bus < core_.buses.size(); ++bus)
    core_.SendNow(bus, Stop{}, kBroadcastNode);
  if (!busy()) return;
  stopping_ = true;
  failure_ = reason;
  EndAllLate(reason);
  start_repeat_ = kNever;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const PositionerIndex i{n};
    // The broadcast may be lost to some: each unit that may move is asked to stop until it answers.
    if (part_[n] == Part::kMoving && IsUnderWay(core_.unit(i).view.phase)) {
      core_.Forget(i);
      core_.Ask(i, Stop{});
    }
  }
  switch (state_) {
    case State::kGathering:
    case State::kPlanning:
    case State::kMeasuring:
      FinishWhenDurable(ConfigurationState::kStopped);
      break;
    case State::kUploading:
    case State::kCommitting:
      TakeBackIntents();
      Disarm();
      break;
    case State::kHomeCommitting:
      TakeBackIntents();
      FinishWhenDurable(ConfigurationState::kStopped);
      break;
    case State::kIdle:
    case State::kDisarming:
    case State::kMoving:
    case State::kHoming:
    case State::kReporting:
      break;  // Advance ends it when all have answered
  }
}

void ConfigurationExecutor::StopUnit(PositionerIndex i) {
  SetOutcome(i, TargetOutcome::kStopped, "stopped by the operator");
  if (busy()) Exclude(i);
  if (const Late* late = FindLate(i); late != nullptr && late->stage != Late::Stage::kStarted) {
    EndLate(*late, {ErrorCode::kRefused, core_.NameOf(i) + " was stopped by the operator"});
    Withdraw(i);
    std::erase_if(late_, [i](const Late& other) { return other.unit == i; });
    if (core_.unit(i).question) return;  // it gives its move back, or is stopped already
  }
  if (!IsUnderWay(core_.unit(i).view.phase)) {
    core_.SendNow(core_.unit(i).bus, Stop{}, core_.layout.unit(i).node);
    return;
  }
  StopFollowers(i, {core_.now, core_.now + core_.Patience()},
                core_.NameOf(i) + " was stopped and may stand in its way");
  StopOne(i, "by the operator");
}

void ConfigurationExecutor::StopOne(PositionerIndex i, const std::string& reason) {
  core_.Forget(i);
  core_.Ask(i, Stop{});
  core_.Raise(Severity::kInfo, i, {}, core_.NameOf(i) + " is stopped: " + reason);
}

}  // namespace focalfleet
