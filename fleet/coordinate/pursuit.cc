#include "fleet/coordinate/pursuit.h"

#include <algorithm>

#include "fleet/estimate.h"
#include "protocol/base/check.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

// Units of one bus that are uploaded at once: enough to keep the bus busy while answers are under
// way.
constexpr std::uint32_t kUploadsPerBus = 16;
constexpr DurationNs kGatherStep = Milliseconds(50);
constexpr int kStartRepeats = 2;
constexpr std::uint8_t kStrikesMax =
    1;  // a second refusal or missed start in one goal is no accident

std::uint64_t FramesOf(const Core& core) {
  std::uint64_t frames = 0;
  for (const BusRecord& bus : core.buses) frames += bus.view.frames_sent + bus.view.frames_received;
  return frames;
}

}  // namespace

Pursuit::Pursuit(Core* core, Contact* contact)
    : core_(*core),
      contact_(*contact),
      excluded_(core->units.size(), 0),
      strikes_(core->units.size(), 0),
      before_(core->units.size()),
      plan_of_(core->units.size(), kNoPlan),
      part_(core->units.size(), Part::kNone),
      stage_tries_(core->units.size(), 0),
      waiting_(core->buses.size()),
      uploading_(core->buses.size(), 0) {}

// ---- the goal

Status Pursuit::Apply(std::uint64_t request, const ApplyCommand& command) {
  if (busy())
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) + " (" +
                                         view_.source +
                                         ") is under way: stop it or wait until it ends");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.targets.size() != core_.units.size())
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  targets_ = command.targets;
  fixed_ = command.fixed;
  Begin(request, command.source);
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    UnitView& view = core_.units[n].view;
    view.target = targets_[n];
    view.outcome = TargetOutcome::kNone;
    view.outcome_reason.clear();
    core_.Changed({n});
    if (!targets_[n]) continue;
    ++view_.targeted;
    SetOutcome({n}, TargetOutcome::kPending);
    if (!view.enabled)
      SetOutcome({n}, TargetOutcome::kRefused, "disabled: " + view.disabled_reason);
  }
  Record();
  return {};
}

Status Pursuit::Home(std::uint64_t request, const HomeCommand& command) {
  if (busy())
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) +
                                         " is under way: stop it or wait until it ends");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.units.empty()) return Fail(ErrorCode::kInvalid, "no unit to home");
  for (const PositionerIndex i : command.units)
    if (core_.unit(i).view.phase != kReady)
      return Fail(ErrorCode::kRefused,
                  core_.NameOf(i) + " cannot home: its phase is " + Name(core_.unit(i).view.phase));
  targets_.assign(core_.units.size(), std::nullopt);
  to_home_ = command.units;
  std::sort(to_home_.begin(), to_home_.end());
  to_home_.erase(std::unique(to_home_.begin(), to_home_.end()), to_home_.end());
  fixed_ = false;
  unproven_ = command.unproven;
  Begin(request, "home");
  if (unproven_)
    core_.Raise(Severity::kWarning, {}, {},
                "homing of " + std::to_string(command.units.size()) +
                    " units without proof that their neighbours are out of the way, as commanded");
  view_.targeted = static_cast<std::uint32_t>(to_home_.size());
  for (const PositionerIndex i : to_home_) SetOutcome(i, TargetOutcome::kPending);
  Record();
  return {};
}

void Pursuit::Begin(std::uint64_t request, std::string source) {
  request_ = request;
  failure_.clear();
  stopping_ = false;
  view_ = {.id = core_.next_configuration++,
           .source = std::move(source),
           .state = ConfigurationState::kPlanning,
           .began = core_.now,
           .started = kNever};
  std::fill(excluded_.begin(), excluded_.end(), std::uint8_t{0});
  std::fill(strikes_.begin(), strikes_.end(), std::uint8_t{0});
  frames_before_ = FramesOf(core_);
  for (BusRecord& bus : core_.buses) bus.view.load_max = 0;
  Gather();
  core_.out->replies.push_back({request_, false, {}, "configuration " + std::to_string(view_.id)});
}

void Pursuit::Gather() {
  gather_until_ = core_.now + core_.config.silence_limit;
  due_ = core_.now;
  SetState(State::kGathering);
}

void Pursuit::GatherIfDue() {
  const bool waiting =
      std::any_of(core_.units.begin(), core_.units.end(), [](const UnitRecord& unit) {
        return unit.view.phase == kIdentifying ||
               (unit.view.phase == kAbsent && !unit.asked_once) || unit.view.phase == kSettling;
      });
  if (waiting && core_.now < gather_until_) {
    due_ = core_.now + kGatherStep;
    return;
  }
  BeginRound();
}

// ---- planning

void Pursuit::BeginRound() {
  if (view_.round == limits::kRoundsPerConfiguration) {
    failure_ = "gave up after " + std::to_string(view_.round) + " rounds";
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  ++view_.round;
  PlanJob job{
      .job = ++job_, .start = {}, .targets = {}, .frozen = {}, .options = {}, .to_home = to_home_};
  job.options.fixed = fixed_;
  job.options.lead_apart = true;
  job.unproven = unproven_;
  bool any = !to_home_.empty();
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    const bool usable = view.phase == kReady && view.enabled && excluded_[n] == 0;
    job.start.push_back(view.knowledge);
    job.frozen.push_back(usable ? 0 : 1);
    std::optional<Pose> target;
    if (view.outcome == TargetOutcome::kPending && to_home_.empty()) {
      if (!usable) {
        SetOutcome({n}, TargetOutcome::kFailed, std::string("is ") + Name(view.phase));
      } else if (!IsPlace(view.knowledge)) {
        SetOutcome({n}, TargetOutcome::kRefused,
                   std::string("its position is ") + Name(view.knowledge[0].witness) +
                       ": home it, or measure it");
      } else {
        target = targets_[n];
        any = true;
      }
    }
    job.targets.push_back(target);
  }
  if (!any) {
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  core_.out->plan_job = std::move(job);
  view_.state = ConfigurationState::kPlanning;
  SetState(State::kPlanning);
}

void Pursuit::OnPlan(const PlanDone& done) {
  if (state_ != State::kPlanning || done.job != job_) return;  // of a goal that was stopped
  if (!done.plan) {
    failure_ = done.plan.error().text;
    if (view_.round == 1) {
      core_.out->replies.push_back({request_, true, done.plan.error(), {}});
      request_ = 0;
    }
    for (std::uint32_t n = 0; n < core_.units.size(); ++n)
      if (core_.units[n].view.outcome == TargetOutcome::kPending)
        SetOutcome({n}, TargetOutcome::kRefused, failure_);
    FinishWhenDurable(ConfigurationState::kFailed);
    return;
  }
  TakePlan(done);
}

void Pursuit::TakePlan(const PlanDone& done) {
  plan_ = *done.plan;
  if (!plan_.too_near.empty())
    core_.Raise(Severity::kWarning, {}, {}, plan_.too_near + ": they may touch, and are led apart");
  homing_ = done.homing;
  const bool stale = std::any_of(plan_.moves.begin(), plan_.moves.end(), [&](const UnitPlan& move) {
    const UnitView& view = core_.unit(move.unit).view;
    return view.phase != kReady || !IsPlace(view.knowledge) || PlaceOf(view.knowledge) != move.from;
  });
  if (stale) {  // somebody fell out while the plan was made
    BeginRound();
    return;
  }
  for (const Unserved& unserved : plan_.unserved)
    if (core_.unit(unserved.unit).view.outcome == TargetOutcome::kPending)
      SetOutcome(unserved.unit, TargetOutcome::kRefused,
                 std::string(Name(unserved.why)) +
                     (unserved.by ? " by " + core_.NameOf(*unserved.by) : ""));
  const PlanEstimate estimate = Estimate(plan_, core_.layout, core_.drives, MotorModel{});
  view_.makespan_predicted_s += estimate.makespan_s;
  view_.energy_J += estimate.energy_J;
  view_.peak_power_W = std::max(view_.peak_power_W, estimate.peak_power_W);
  move_ = core_.next_move;
  core_.next_move = {static_cast<std::uint16_t>(move_.value == 65'535 ? 1 : move_.value + 1)};
  if (plan_.moves.empty()) {
    RoundOver();
    return;
  }
  view_.state = ConfigurationState::kUploading;
  SetState(State::kUploading);
  for (std::size_t n = 0; n < plan_.moves.size(); ++n) {
    const PositionerIndex i = plan_.moves[n].unit;
    plan_of_[i.value] = n;
    stage_tries_[i.value] = 0;
    SetPart(i, Part::kWaiting);
    core_.SetPhase(i, kStaging);
    waiting_[core_.unit(i).bus].push_back(i);
  }
  PumpUploads();
}

// ---- uploading

StagedMove Pursuit::StagedMoveOf(PositionerIndex i) const {
  const UnitPlan& plan = plan_.moves[plan_of_[i.value]];
  return {.move = move_, .mode = plan.mode, .path = plan.path};
}

void Pursuit::PumpUploads() {
  for (std::size_t bus = 0; bus < waiting_.size(); ++bus) {
    while (!waiting_[bus].empty() && uploading_[bus] < kUploadsPerBus) {
      const PositionerIndex i = waiting_[bus].front();
      waiting_[bus].pop_front();
      if (part_[i.value] == Part::kWaiting && core_.unit(i).view.phase == kStaging) Upload(i);
    }
  }
}

void Pursuit::Upload(PositionerIndex i) {
  const StagedMove move = StagedMoveOf(i);
  BusRecord& bus = core_.bus_of(i);
  core_.Forget(i);
  if (part_[i.value] != Part::kUploading) {
    ++uploading_[core_.unit(i).bus];
    SetPart(i, Part::kUploading);
  }
  const Address to{core_.layout.unit(i).node, 0};
  bool room = bus.schedule.Enqueue(
      {Encode(HostMessage{StageBegin{
                  move.move, {move.path[0].size(), move.path[1].size()}, move.mode}},
              to),
       0,
       {}});
  for (const Axis axis : kAxes) {
    std::uint8_t index = 0;
    for (const Segment& segment : move.path[Index(axis)].segments())
      room = bus.schedule.Enqueue(
                 {Encode(HostMessage{StageSegment{axis, index++, segment}}, to), 0, {}}) &&
             room;
  }
  // Where the queue had no room the read-back shows it, and the move is sent again.
  core_.SetPhase(i, kConfirming);
  core_.Ask(i, Confirm{move_});
  static_cast<void>(room);
}

void Pursuit::OnConfirm(PositionerIndex i, const ConfirmReply& reply) {
  if (core_.unit(i).view.phase != kConfirming || reply.move != move_) return;
  const StagedMove move = StagedMoveOf(i);
  const std::uint32_t digest = Digest(move);
  if (reply.answer == Answer::kOk && reply.digest == digest) {
    core_.SetPhase(i, kArming);
    core_.Ask(i, Arm{move_, digest});
  } else if ((reply.answer == Answer::kOk || reply.answer == Answer::kIncomplete ||
              reply.answer == Answer::kWrongMove) &&
             ++stage_tries_[i.value] <= limits::kStageRetries) {
    ++core_.bus_of(i).view.retries;
    core_.SetPhase(i, kStaging);
    Upload(i);
  } else {
    FallOut(i, std::string("refuses its move: ") +
                   (reply.answer == Answer::kOk ? "its read-back differs" : Name(reply.answer)));
  }
}

void Pursuit::OnArm(PositionerIndex i, const ArmReply& reply) {
  if (core_.unit(i).view.phase != kArming || reply.move != move_) return;
  if (reply.answer != Answer::kOk) {
    FallOut(i, std::string("refuses to arm: ") + Name(reply.answer));
    return;
  }
  core_.SetPhase(i, kArmed);
  core_.SetDue(i, kNever);
  --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kHolding);
}

void Pursuit::FallOut(PositionerIndex i, const std::string& reason) {
  core_.Forget(i);
  Strike(i, reason);
  core_.Raise(Severity::kWarning, i, {}, core_.NameOf(i) + " " + reason);
  if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kNone);
  // Whatever it holds is taken back by reading it anew.
  contact_.Identify(i);
}

void Pursuit::UploadsOver() {
  if (parts_[static_cast<std::size_t>(Part::kWaiting)] != 0 ||
      parts_[static_cast<std::size_t>(Part::kUploading)] != 0)
    return;
  if (parts_[static_cast<std::size_t>(Part::kHolding)] == plan_.moves.size() && !stopping_) {
    CommitRound();
  } else {
    Disarm();
  }
}

void Pursuit::Disarm() {
  SetState(State::kDisarming);
  for (const UnitPlan& move : plan_.moves) {
    if (part_[move.unit.value] == Part::kNone) continue;
    const UnitPhase phase = core_.unit(move.unit).view.phase;
    if (phase == kStaging) {  // nothing was sent yet
      SetPart(move.unit, Part::kNone);
      core_.SetPhase(move.unit, kReady);
      core_.SetDue(move.unit, core_.now + core_.config.poll_period);
    } else if (IsLoaded(phase)) {
      core_.Forget(move.unit);
      core_.Ask(move.unit, Stop{});
    }
  }
  for (auto& queue : waiting_) queue.clear();
}

// ---- moving

IntentRow Pursuit::IntentOf(PositionerIndex i) const {
  const UnitPlan& plan = plan_.moves[plan_of_[i.value]];
  IntentRow row{.configuration = view_.id,
                .serial = core_.units[i.value].view.serial,
                .unit = core_.layout.unit(i).id,
                .move = move_,
                .from = plan.from,
                .to = plan.to,
                .hull = {}};
  for (const Axis axis : kAxes) {
    const Span span = SpanOf(plan.from[Index(axis)], plan.path[Index(axis)]);
    row.hull[Index(axis)] = {Witness::kInterval, span.low, span.high};
  }
  return row;
}

void Pursuit::Intend(PositionerIndex i, const IntentRow& intent) {
  before_[i.value] = core_.unit(i).view.knowledge;
  core_.intents[intent.serial] = intent;
  core_.Note(intent);
  // From here on the store must not claim the old place: the unit may be anywhere on its way.
  core_.Know(i, intent.hull, Origin::kMove);
}

void Pursuit::TakeBackIntents() {
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    if (!before_[n]) continue;
    const PositionerIndex i{n};
    // Who was lost meanwhile keeps its intent: its return decides.
    if (core_.unit(i).view.phase == kArmed || core_.unit(i).view.phase == kReady) {
      core_.EndIntent(i, IntentEnd::kNeverBegan);
      core_.Know(i, *before_[n], Origin::kMove);
    }
    before_[n].reset();
  }
}

void Pursuit::CommitRound() {
  for (const UnitPlan& move : plan_.moves) {
    Intend(move.unit, IntentOf(move.unit));
  }
  core_.Note(NextMoveRow{core_.next_move});
  view_.state = ConfigurationState::kMoving;
  Record();
  commit_batch_ = core_.batch_now();
  SetState(State::kCommitting);
}

void Pursuit::Start() {
  view_.started = core_.now + core_.config.start_delay;
  last_arrival_ = view_.started;
  start_repeats_ = 0;
  for (const UnitPlan& move : plan_.moves) {
    UnitRecord& unit = core_.unit(move.unit);
    SetPart(move.unit, Part::kMoving);
    core_.SetPhase(move.unit, kMoving);
    before_[move.unit.value].reset();
    // Spread over a poll period, so that a bus never hears all its units at once.
    unit.next_poll = view_.started + core_.config.poll_period +
                     DurationNs{core_.config.poll_period.ns * (move.unit.value % 97) / 97};
    core_.SetDue(move.unit, unit.next_poll);
  }
  SetState(State::kMoving);
  RepeatStart();
}

void Pursuit::RepeatStart() {
  const DurationNs left = view_.started - core_.now;
  const auto ticks = static_cast<std::uint32_t>(std::max<std::int64_t>(left.ns, 0) / kTick.ns);
  std::vector<std::uint8_t> told(core_.buses.size(), 0);
  for (const UnitPlan& move : plan_.moves) {
    const std::size_t bus = core_.unit(move.unit).bus;
    if (told[bus]++ == 0) core_.SendNow(bus, focalfleet::Start{move_, ticks}, kBroadcastNode);
    told[bus] = 1;
  }
  start_repeat_ = ++start_repeats_ > kStartRepeats
                      ? kNever
                      : core_.now + DurationNs{core_.config.start_delay.ns / (kStartRepeats + 2)};
  due_ = start_repeat_;
}

std::optional<Pursuit::Course> Pursuit::CourseOf(PositionerIndex i) const {
  if (part_[i.value] != Part::kMoving || plan_of_[i.value] == kNoPlan) return std::nullopt;
  return Course{&plan_.moves[plan_of_[i.value]], view_.started};
}

void Pursuit::StopFollowers(PositionerIndex first, const std::string& reason) {
  std::vector<PositionerIndex> open{first};
  while (!open.empty()) {
    const PositionerIndex i = open.back();
    open.pop_back();
    if (plan_of_[i.value] == kNoPlan) continue;
    for (const auto& follower : plan_.moves[plan_of_[i.value]].followers) {
      UnitRecord& unit = core_.unit(follower.unit);
      const bool asked = unit.question && std::holds_alternative<Stop>(unit.question->message);
      if (part_[follower.unit.value] != Part::kMoving || unit.view.phase != kMoving || asked)
        continue;
      StopOne(follower.unit, reason);
      open.push_back(follower.unit);
    }
  }
}

// ---- homing

IntentRow Pursuit::HomingIntentOf(PositionerIndex i) const {
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
    row.from[Index(axis)] = unknown ? low : known.low;
    row.to[Index(axis)] = to;
    row.hull[Index(axis)] = {Witness::kInterval, std::min(unknown ? low : known.low, to),
                             std::max(unknown ? high : known.high, to)};
  }
  return row;
}

void Pursuit::CommitHoming() {
  std::erase_if(homing_, [&](PositionerIndex i) {
    if (core_.unit(i).view.phase == kReady) return false;
    SetOutcome(i, TargetOutcome::kFailed, std::string("is ") + Name(core_.unit(i).view.phase));
    std::erase(to_home_, i);
    return true;
  });
  if (homing_.empty()) {
    RoundOver();
    return;
  }
  // A new id: the moves that made way for these units had their own.
  move_ = core_.next_move;
  core_.next_move = {static_cast<std::uint16_t>(move_.value == 65'535 ? 1 : move_.value + 1)};
  for (const PositionerIndex i : homing_) {
    Intend(i, HomingIntentOf(i));
  }
  core_.Note(NextMoveRow{core_.next_move});
  view_.state = ConfigurationState::kMoving;
  Record();
  commit_batch_ = core_.batch_now();
  SetState(State::kHomeCommitting);
}

void Pursuit::StartHoming() {
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

void Pursuit::OnHomeReply(PositionerIndex i, const HomeReply& reply) {
  if (core_.unit(i).view.phase != kHoming || reply.move != move_) return;
  core_.SetDue(i, core_.unit(i).next_poll);
  if (reply.answer == Answer::kOk || reply.answer == Answer::kBegunBefore) return;
  SetOutcome(i, TargetOutcome::kFailed, std::string("refuses to home: ") + Name(reply.answer));
  SetPart(i, Part::kNone);
  contact_.Identify(i);
}

// ---- stopping

void Pursuit::StopAll() {
  for (std::size_t bus = 0; bus < core_.buses.size(); ++bus)
    core_.SendNow(bus, Stop{}, kBroadcastNode);
  if (!busy()) return;
  stopping_ = true;
  failure_ = "stopped by the operator";
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

void Pursuit::StopUnit(PositionerIndex i) {
  SetOutcome(i, TargetOutcome::kFailed, "stopped by the operator");
  if (busy()) Exclude(i);
  if (!IsUnderWay(core_.unit(i).view.phase)) {
    core_.SendNow(core_.unit(i).bus, Stop{}, core_.layout.unit(i).node);
    return;
  }
  StopFollowers(i, core_.NameOf(i) + " was stopped and may stand in its way");
  StopOne(i, "by the operator");
}

void Pursuit::StopOne(PositionerIndex i, const std::string& reason) {
  core_.Forget(i);
  core_.Ask(i, Stop{});
  core_.Raise(Severity::kInfo, i, {}, core_.NameOf(i) + " is stopped: " + reason);
}

// ---- going on

void Pursuit::Advance() {
  for (std::size_t n = 0; n < core_.events.size(); ++n) Take(core_.events[n]);
  core_.events.clear();
  ReportArrivals();
  if (busy()) view_.frames = FramesOf(core_) - frames_before_;
  if (core_.now >= due_) {
    due_ = kNever;
    if (state_ == State::kGathering) GatherIfDue();
    if (state_ == State::kMoving && core_.now >= start_repeat_) RepeatStart();
  }
  const auto count = [&](Part part) { return parts_[static_cast<std::size_t>(part)]; };
  switch (state_) {
    case State::kUploading:
      PumpUploads();
      UploadsOver();
      break;
    case State::kDisarming:
      if (count(Part::kWaiting) + count(Part::kUploading) + count(Part::kHolding) == 0)
        stopping_ ? FinishWhenDurable(ConfigurationState::kStopped) : Gather();
      break;
    case State::kCommitting:
      if (core_.committed_through < commit_batch_) break;
      if (count(Part::kHolding) == plan_.moves.size()) {
        Start();
      } else {  // somebody fell out while the store wrote
        TakeBackIntents();
        Disarm();
      }
      break;
    case State::kHomeCommitting:
      if (core_.committed_through >= commit_batch_) StartHoming();
      break;
    case State::kMoving:
    case State::kHoming:
      if (count(Part::kMoving) == 0) RoundOver();
      break;
    case State::kReporting:
      if (arrivals_.empty()) Finish();
      break;
    case State::kIdle:
    case State::kGathering:
    case State::kPlanning:
      break;
  }
}

void Pursuit::Take(const UnitEvent& event) {
  const PositionerIndex i = event.unit;
  if (part_[i.value] == Part::kNone) return;
  switch (event.kind) {
    case UnitEventKind::kReady:
    case UnitEventKind::kStopped:
      Settled(i);
      break;
    case UnitEventKind::kNeverBegan:
      Strike(i, "does not begin to move");
      StopFollowers(i, core_.NameOf(i) + " stands in its way");
      break;  // settled when it has been read again
    case UnitEventKind::kLost:
      SetOutcome(i, TargetOutcome::kFailed, event.reason);
      Exclude(i);
      if (part_[i.value] == Part::kMoving)
        StopFollowers(i, core_.NameOf(i) + " may stand in its way");
      if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
      SetPart(i, Part::kNone);
      break;
  }
}

void Pursuit::Settled(PositionerIndex i) {
  if (part_[i.value] == Part::kMoving) {
    last_arrival_ = std::max(last_arrival_, core_.now);
    const UnitView& view = core_.unit(i).view;
    const bool homed = state_ == State::kHoming && IsPlace(view.knowledge);
    if (homed) std::erase(to_home_, i);
    if (view.outcome == TargetOutcome::kPending && IsPlace(view.knowledge) &&
        (homed || (view.target && PlaceOf(view.knowledge) == *view.target)))
      arrivals_.push_back({core_.batch_now(), i});
    if (!homed && view.target && PlaceOf(view.knowledge) != *view.target && !stopping_)
      StopFollowers(i, core_.NameOf(i) + " did not get out of its way");
  }
  if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kNone);
}

void Pursuit::ReportArrivals() {
  while (!arrivals_.empty() && core_.committed_through >= arrivals_.front().batch) {
    SetOutcome(arrivals_.front().unit, TargetOutcome::kArrived);
    arrivals_.pop_front();
  }
}

void Pursuit::RoundOver() {
  if (view_.started != kNever && last_arrival_ > view_.started)
    view_.makespan_s += (last_arrival_ - view_.started).seconds();
  view_.started = kNever;
  for (const UnitPlan& move : plan_.moves) plan_of_[move.unit.value] = kNoPlan;
  const bool was_homing = state_ == State::kHoming;
  plan_.moves.clear();
  if (stopping_) {
    FinishWhenDurable(ConfigurationState::kStopped);
    return;
  }
  if (!to_home_.empty() && !was_homing && !homing_.empty()) {
    CommitHoming();
    return;
  }
  if (was_homing) {
    // What did not get home in its wave is not tried again: its reason is on record.
    for (const PositionerIndex i : homing_) std::erase(to_home_, i);
    homing_.clear();
    view_.round = 0;  // each wave has the full number of tries
    to_home_.empty() ? FinishWhenDurable(ConfigurationState::kDone) : Gather();
    return;
  }
  JudgeTargets();
}

void Pursuit::JudgeTargets() {
  bool again = false;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (view.outcome != TargetOutcome::kPending) continue;
    if (IsPlace(view.knowledge) && view.target && PlaceOf(view.knowledge) == *view.target) {
      const bool noted = std::any_of(arrivals_.begin(), arrivals_.end(),
                                     [&](const Arrival& a) { return a.unit.value == n; });
      if (!noted) arrivals_.push_back({0, {n}});  // stood there from the start
    } else {
      again = true;
    }
  }
  again ? Gather() : FinishWhenDurable(ConfigurationState::kDone);
}

void Pursuit::FinishWhenDurable(ConfigurationState end) {
  end_ = end;
  due_ = core_.now;
  SetState(State::kReporting);
}

void Pursuit::Strike(PositionerIndex i, const std::string& reason) {
  if (strikes_[i.value]++ < kStrikesMax) return;
  SetOutcome(i, TargetOutcome::kFailed, reason);
  Exclude(i);
}

void Pursuit::Exclude(PositionerIndex i) { excluded_[i.value] = 1; }

void Pursuit::Finish() {
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    part_[n] = Part::kNone;
    plan_of_[n] = kNoPlan;
    if (core_.units[n].view.outcome == TargetOutcome::kPending)
      SetOutcome({n}, TargetOutcome::kFailed, failure_.empty() ? "did not arrive" : failure_);
  }
  parts_ = {};
  plan_ = {};
  homing_.clear();
  to_home_.clear();
  std::fill(uploading_.begin(), uploading_.end(), 0u);
  for (auto& queue : waiting_) queue.clear();
  view_.state = end_;
  due_ = kNever;
  SetState(State::kIdle);
  Record();
  if (request_ != 0) core_.out->replies.push_back({request_, true, {}, std::string(Name(end_))});
  request_ = 0;
}

void Pursuit::SetOutcome(PositionerIndex i, TargetOutcome outcome, std::string reason) {
  UnitView& view = core_.unit(i).view;
  if (view.outcome == outcome) return;
  // An arrival or a failure is only taken back by a new goal.
  if (outcome != TargetOutcome::kPending && view.outcome != TargetOutcome::kPending) return;
  view.outcome = outcome;
  view.outcome_reason = std::move(reason);
  if (outcome == TargetOutcome::kArrived) ++view_.arrived;
  if (outcome == TargetOutcome::kRefused) ++view_.refused;
  if (outcome == TargetOutcome::kFailed) ++view_.failed;
  core_.Changed(i);
}

void Pursuit::SetPart(PositionerIndex i, Part part) {
  Part& mine = part_[i.value];
  if (mine != Part::kNone) --parts_[static_cast<std::size_t>(mine)];
  if (part != Part::kNone) ++parts_[static_cast<std::size_t>(part)];
  mine = part;
}

void Pursuit::SetState(State state) { state_ = state; }

void Pursuit::Record() {
  core_.Note(ConfigurationRow{.id = view_.id,
                              .source = view_.source,
                              .state = view_.state,
                              .targeted = view_.targeted,
                              .arrived = view_.arrived,
                              .refused = view_.refused,
                              .failed = view_.failed,
                              .makespan_predicted_s = view_.makespan_predicted_s,
                              .makespan_s = view_.makespan_s,
                              .energy_J = view_.energy_J,
                              .peak_power_W = view_.peak_power_W});
}

}  // namespace focalfleet
