#include "fleet/coordinate/executor.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "fleet/coordinate/stall_detection.h"
#include "protocol/base/check.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

constexpr DurationNs kGatherStep = Milliseconds(50);
constexpr std::uint8_t kStrikesMax =
    1;  // a second refusal or missed start in one goal is no accident

std::uint64_t FramesOf(const Core& core) {
  std::uint64_t frames = 0;
  for (const BusRecord& bus : core.buses) frames += bus.view.frames_sent + bus.view.frames_received;
  return frames;
}

std::uint64_t UploadBitsOf(const Core& core) {
  std::uint64_t bits = 0;
  for (const BusRecord& bus : core.buses) bits += bus.view.upload.bits;
  return bits;
}

std::string DaemonEnded(std::uint64_t configuration) {
  return "configuration " + std::to_string(configuration) +
         " has failed: the daemon ended; what moves finishes by itself";
}

}  // namespace

ConfigurationExecutor::ConfigurationExecutor(Core* core, UnitSessions* sessions)
    : core_(*core),
      sessions_(*sessions),
      excluded_(core->units.size(), 0),
      strikes_(core->units.size(), 0),
      before_(core->units.size()),
      plan_of_(core->units.size(), kNoPlan),
      part_(core->units.size(), Part::kNone),
      stage_tries_(core->units.size(), 0),
      waiting_(core->buses.size()),
      uploading_(core->buses.size(), 0),
      goes_on_(core->units.size(), 0) {
  if (core_.earlier_configurations.empty()) return;
  const ConfigurationRow& last = core_.earlier_configurations.back();
  view_ = {.id = last.id,
           .source = last.source,
           .state = IsOver(last.state) ? last.state : ConfigurationState::kFailed,
           .targeted = last.targeted,
           .arrived = last.arrived,
           .refused = last.refused,
           .failed = last.failed,
           .stopped = last.stopped,
           .unmeasured = last.unmeasured,
           .makespan_predicted_s = last.makespan_predicted_s,
           .makespan_s = last.makespan_s,
           .energy_J = last.energy_J,
           .peak_power_W = last.peak_power_W,
           .began = {},
           .started = kNever};
}

// ---- the goal

void ConfigurationExecutor::GiveUp() {
  if (!busy()) return;
  view_.state = ConfigurationState::kFailed;
  core_.Raise(Severity::kWarning, {}, {}, DaemonEnded(view_.id));
  Record();
}

void ConfigurationExecutor::EndThoseOfAnEarlierRun() {
  for (ConfigurationRow& row : core_.earlier_configurations) {
    if (IsOver(row.state)) continue;
    row.state = ConfigurationState::kFailed;
    core_.Raise(Severity::kWarning, {}, {}, DaemonEnded(row.id));
    core_.Note(row);
  }
  core_.earlier_configurations.clear();
}

Status ConfigurationExecutor::Apply(std::uint64_t request, const ApplyCommand& command) {
  if (busy())
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) + " (" +
                                         view_.source +
                                         ") is under way: stop it or wait until it ends");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.targets.size() != core_.units.size())
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  if (!command.target_ids.empty() && command.target_ids.size() != core_.units.size())
    return Fail(ErrorCode::kInvalid, "names of targets for another layout");
  if (!command.offsets.empty() && command.offsets.size() != core_.units.size())
    return Fail(ErrorCode::kInvalid, "offsets for another layout");
  if (command.measure && !CanMeasure())
    return Fail(ErrorCode::kRefused, "there is no camera to measure with: [camera] directory");
  targets_ = command.targets;
  fixed_ = command.fixed;
  measure_ = command.measure;
  target_ids_ = command.target_ids;
  Begin(request, ConfigurationKind::kApply, command.source);
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (!targets_[n]) continue;
    ++view_.targeted;
    SetOutcome({n}, TargetOutcome::kPending);
    if (!view.enabled)
      SetOutcome({n}, TargetOutcome::kRefused, "disabled: " + view.disabled_reason);
    // Observed, a unit comes as its count has it.
    const bool expects = !command.offsets.empty() && command.offsets[n] && view.enabled &&
                         view.phase == kReady && IsPlace(view.knowledge) &&
                         !(measure_ && measure_->observe);
    if (expects) core_.Expect({n}, *command.offsets[n]);
    const bool in_reach = core_.NearestInReach({n}, *targets_[n]) == *targets_[n];
    if (!in_reach && !measure_)
      SetOutcome({n}, TargetOutcome::kRefused, "its range, as it was measured, ends before it");
    if (measure_) targets_[n] = GoalFor({n}, *targets_[n]);
  }
  goals_ = targets_;
  Record();
  return {};
}

Status ConfigurationExecutor::Home(std::uint64_t request, const HomeCommand& command) {
  if (busy())
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) +
                                         " is under way: stop it or wait until it ends");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (command.units.empty()) return Fail(ErrorCode::kInvalid, "no unit to home");
  for (const PositionerIndex i : command.units)
    if (core_.unit(i).view.phase != kReady)
      return Fail(ErrorCode::kRefused, core_.NameOf(i) + " cannot home: it " + core_.TroubleOf(i));
  targets_.assign(core_.units.size(), std::nullopt);
  to_home_ = command.units;
  std::sort(to_home_.begin(), to_home_.end());
  to_home_.erase(std::unique(to_home_.begin(), to_home_.end()), to_home_.end());
  fixed_ = false;
  measure_.reset();
  unproven_ = command.unproven;
  Begin(request, ConfigurationKind::kHome, "home");
  if (unproven_)
    core_.Raise(Severity::kWarning, {}, {},
                "homing of " + std::to_string(command.units.size()) +
                    " units without proof that their neighbours are out of the way, as commanded");
  view_.targeted = static_cast<std::uint32_t>(to_home_.size());
  for (const PositionerIndex i : to_home_) SetOutcome(i, TargetOutcome::kPending);
  Record();
  return {};
}

bool ConfigurationExecutor::CanMeasure() const {
  return core_.config.has_camera ||
         (core_.config.reads_sensors &&
          std::ranges::any_of(core_.layout.units(),
                              [](const Unit& unit) { return unit.sensors > 0; }));
}

Status ConfigurationExecutor::Measure(std::uint64_t request) {
  if (busy())
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) +
                                         " is under way: stop it or wait until it ends");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused,
                "the store cannot be written: what is found could not be kept");
  if (!CanMeasure())
    return Fail(ErrorCode::kRefused, "there is no camera to measure with: [camera] directory");
  targets_.clear();
  for (const UnitRecord& unit : core_.units) targets_.push_back(unit.view.target);
  fixed_ = false;
  measure_ = ApplyCommand::Measure{};
  Begin(request, ConfigurationKind::kMeasure, "measure");
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    if (!core_.units[n].view.enabled) continue;
    ++view_.targeted;
    SetOutcome({n}, TargetOutcome::kPending);
  }
  Record();
  return {};
}

void ConfigurationExecutor::Begin(std::uint64_t request, ConfigurationKind kind,
                                  std::string source) {
  request_ = request;
  failure_.clear();
  stopping_ = false;
  corrections_left_ = measure_ ? measure_->corrections : std::uint8_t{0};
  goes_past_ = measure_ && !measure_->observe;
  sets_out_ = true;
  measured_batch_ = 0;
  play_.resize(core_.units.size());
  ended_.resize(core_.units.size(), kNever);
  approaches_.assign(core_.units.size(), std::nullopt);
  waves_left_ = 0;
  exposures_refused_ = 0;
  looked_first_ = false;
  is_locating_ = false;
  view_ = {.id = core_.next_configuration++,
           .kind = kind,
           .source = std::move(source),
           .state = ConfigurationState::kPlanning,
           .began = core_.now,
           .started = kNever};
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    UnitView& view = core_.units[n].view;
    view.target = targets_[n];
    view.outcome = TargetOutcome::kNone;
    view.outcome_reason.clear();
    view.measurement.reset();
    view.error_um.reset();
    core_.Changed({n});
  }
  std::fill(excluded_.begin(), excluded_.end(), std::uint8_t{0});
  std::fill(strikes_.begin(), strikes_.end(), std::uint8_t{0});
  frames_before_ = FramesOf(core_);
  for (BusRecord& bus : core_.buses) {
    bus.view.load_max = 0;
    bus.view.upload = {};
  }
  Gather();
  core_.out->replies.push_back({request_, false, {}, "configuration " + std::to_string(view_.id)});
}

void ConfigurationExecutor::Gather() {
  gather_until_ = core_.now + core_.config.silence_limit;
  due_ = core_.now;
  SetState(State::kGathering);
}

void ConfigurationExecutor::GatherIfDue() {
  const bool waiting =
      std::any_of(core_.units.begin(), core_.units.end(), [](const UnitRecord& unit) {
        return unit.view.phase == kIdentifying ||
               (unit.view.phase == kAbsent && !unit.asked_once) || unit.view.phase == kSettling;
      });
  if ((waiting && core_.now < gather_until_) || !core_.MovesAreReserved()) {
    due_ = core_.now + kGatherStep;
    return;
  }
  if (view_.kind == ConfigurationKind::kMeasure) return StartLook(Look::kOnly);
  if (LooksFirst()) return StartLook(Look::kBefore);
  BeginRound();
}

// ---- planning

void ConfigurationExecutor::BeginRound() {
  if (view_.round == limits::kRoundsPerConfiguration) {
    failure_ = "gave up after " + std::to_string(view_.round) + " rounds";
    FinishWhenDurable(ConfigurationState::kDone);
    return;
  }
  ++view_.round;
  PlanJob job{.job = ++job_,
              .start = {},
              .targets = {},
              .frozen = {},
              .offsets = {},
              .options = {},
              .to_home = to_home_};
  job.options.fixed = fixed_;
  job.options.lead_apart = true;
  job.options.leave_stuck = !view_.measured.empty();
  job.options.start_skew_s = round_skew_s_ = planned_skew_s_;
  job.options.notice_s = StallDetectionOf(core_.config).notice.seconds();
  job.unproven = unproven_;
  bool any = !to_home_.empty();
  if (!goes_past_) SetNext();
  if (sets_out_) stood_.assign(core_.units.size(), std::nullopt);
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    const bool usable = view.phase == kReady && view.enabled && excluded_[n] == 0;
    if (sets_out_ && IsPlace(view.knowledge)) stood_[n] = PlaceOf(view.knowledge);
    job.start.push_back(view.knowledge);
    job.offsets.push_back(view.offset);
    job.frozen.push_back(usable ? 0 : 1);
    std::optional<Pose> target;
    if (view.outcome == TargetOutcome::kPending && to_home_.empty()) {
      if (!usable) {
        SetOutcome({n}, TargetOutcome::kFailed,
                   view.phase == kReady ? "fell out before" : "it " + core_.TroubleOf({n}));
      } else if (!IsPlace(view.knowledge)) {
        SetOutcome({n}, TargetOutcome::kRefused, "its place " + core_.WhyNoPlace({n}));
      } else {
        target = targets_[n];
        any = true;
      }
    }
    job.targets.push_back(target);
  }
  sets_out_ = false;
  if (goes_past_ && !GoPast(&job.targets)) {
    goes_past_ = false;
    waves_left_ = 0;
    SetNext();
    for (std::uint32_t n = 0; n < core_.units.size(); ++n)
      if (job.targets[n]) job.targets[n] = targets_[n];
  }
  if (!any) {
    MeasureOrFinish();
    return;
  }
  core_.out->plan_job = std::move(job);
  view_.state = ConfigurationState::kPlanning;
  SetState(State::kPlanning);
}

void ConfigurationExecutor::OnPlan(const PlanDone& done) {
  if (done.late) return OnLatePlan(done);
  if (state_ != State::kPlanning || done.job != job_) return;  // of a goal that was stopped
  if (!done.plan && goes_past_) {  // then they come to their targets as they can
    core_.Raise(Severity::kWarning, {}, {},
                "no run-up: from which side the targets are approached is left open (" +
                    done.plan.error().text + ")");
    goes_past_ = false;
    waves_left_ = 0;
    Gather();
    return;
  }
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

void ConfigurationExecutor::TakePlan(const PlanDone& done) {
  plan_ = *done.plan;
  if (!plan_.too_near.empty())
    core_.Raise(Severity::kWarning, {}, {}, plan_.too_near + ": they may touch, and are led apart");
  homing_ = done.homing;
  running_ = done.running;
  const bool stale = std::any_of(plan_.moves.begin(), plan_.moves.end(), [&](const UnitPlan& move) {
    const UnitView& view = core_.unit(move.unit).view;
    return view.phase != kReady || !IsPlace(view.knowledge) || PlaceOf(view.knowledge) != move.from;
  });
  if (stale) {  // somebody fell out while the plan was made
    BeginRound();
    return;
  }
  for (const Unserved& unserved : plan_.unserved)
    if (!goes_past_ && core_.unit(unserved.unit).view.outcome == TargetOutcome::kPending)
      SetOutcome(unserved.unit, TargetOutcome::kRefused,
                 std::string(Name(unserved.why)) +
                     (unserved.by ? " by " + core_.NameOf(*unserved.by) : ""));
  prediction_ = done.predicted;
  move_ = core_.TakeMoveId();
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
  PredictUpload();
  PumpUploads();
}

void ConfigurationExecutor::CountPrediction() {
  round_end_s_ = prediction_.makespan_s;
  view_.makespan_predicted_s += prediction_.makespan_s;
  view_.energy_J += prediction_.energy_J;
  view_.peak_power_W = std::max(view_.peak_power_W, prediction_.peak_power_W);
  prediction_ = {};
}

// ---- going on

void ConfigurationExecutor::Advance() {
  for (std::size_t n = 0; n < core_.events.size(); ++n) Take(core_.events[n]);
  core_.events.clear();
  ReportArrivals();
  if (busy()) {
    view_.frames = FramesOf(core_) - frames_before_;
    view_.upload.bits = UploadBitsOf(core_);
  }
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
      AdvanceLate();
      if (RoundIsOver()) RoundOver();
      break;
    case State::kHoming:
      if (count(Part::kMoving) == 0) RoundOver();
      break;
    case State::kReporting:
      if (arrivals_.empty() && core_.committed_through >= measured_batch_) Finish();
      break;
    case State::kMeasuring:
      if (exposure_ == 0 && arrivals_.empty() && SensorsAreRead()) AskForExposure();
      if (is_locating_ && !IsLocating()) LookIsOver();
      break;
    case State::kIdle:
    case State::kGathering:
    case State::kPlanning:
      break;
  }
  SayWhatIsWaitedFor();
}

void ConfigurationExecutor::SayWhatIsWaitedFor() {
  const bool needs_the_store = (state_ == State::kGathering && !core_.MovesAreReserved()) ||
                               state_ == State::kCommitting || state_ == State::kHomeCommitting ||
                               state_ == State::kReporting;
  view_.waiting_for = needs_the_store && core_.store_failing ? "the store, which cannot be written"
                      : state_ == State::kMeasuring && exposure_ != 0 ? "the camera"
                                                                      : "";
}

void ConfigurationExecutor::Take(const UnitEvent& event) {
  const PositionerIndex i = event.unit;
  if (event.kind == UnitEventKind::kForeignStop) {
    StoppedBySomebodyElse(i);
    return;
  }
  if (event.kind == UnitEventKind::kStartReported) {
    NoteStart(i);
    return;
  }
  if (part_[i.value] == Part::kNone) return;
  switch (event.kind) {
    case UnitEventKind::kReady:
    case UnitEventKind::kStopped:
      Settled(i, event.kind);
      break;
    case UnitEventKind::kNeverBegan:
      Strike(i, "does not begin to move");
      StopFollowers(i, {HostInstant{INT64_MIN}, core_.now}, core_.NameOf(i) + " stands in its way");
      break;  // settled when it has been read again
    case UnitEventKind::kUnheard:
      // Until it is heard, or given up, it may also end still.
      if (part_[i.value] == Part::kMoving)
        StopFollowers(i, SeenUntil(i, core_.now + core_.Patience()),
                      core_.NameOf(i) + " is not heard and may stand in its way");
      break;
    case UnitEventKind::kEnded:
      // Where its time is over it has arrived, most likely: its FLASH tells.
      if (const auto course = CourseOf(i); course && !MayHaveArrived(*course))
        StopFollowers(i, SeenUntil(i, core_.now), core_.NameOf(i) + " stands in its way");
      break;
    case UnitEventKind::kLost:
      SetOutcome(
          i, TargetOutcome::kFailed,
          core_.unit(i).view.phase == kFault ? "it " + core_.TroubleOf(i) : "it " + event.reason);
      Exclude(i);
      // Who is silent may move on, and end later.
      if (part_[i.value] == Part::kMoving)
        StopFollowers(i, SeenUntil(i, core_.unit(i).view.phase == kSilent ? kNever : core_.now),
                      core_.NameOf(i) + " may stand in its way");
      if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
      SetPart(i, Part::kNone);
      break;
    case UnitEventKind::kForeignStop:
    case UnitEventKind::kStartReported:
      break;  // above
  }
}

void ConfigurationExecutor::Settled(PositionerIndex i, UnitEventKind how) {
  if (part_[i.value] == Part::kMoving) {
    last_arrival_ = std::max(last_arrival_, core_.now);
    settled_batch_ = core_.batch_now();
    ended_[i.value] = core_.now;
    const UnitView& view = core_.unit(i).view;
    const bool homed =
        state_ == State::kHoming && how == UnitEventKind::kReady && IsPlace(view.knowledge);
    if (homed) std::erase(to_home_, i);
    if (view.outcome == TargetOutcome::kPending && IsPlace(view.knowledge) && !Waits(i) &&
        (homed || (targets_[i.value] && PlaceOf(view.knowledge) == *targets_[i.value])))
      arrivals_.push_back({core_.batch_now(), i});
    // Not the target: whoever only makes way has none, and others may come to theirs by stages.
    const std::size_t plan = plan_of_[i.value];
    const bool reached = plan != kNoPlan && !courses_.contains(i.value) &&
                         IsPlace(view.knowledge) && PlaceOf(view.knowledge) == plan_.moves[plan].to;
    NoteDirections(i, reached ? &plan_.moves[plan] : nullptr);
    if (plan != kNoPlan && PlaceOf(view.knowledge) != plan_.moves[plan].to && !stopping_)
      StopFollowers(i, SeenUntil(i, core_.now), core_.NameOf(i) + " did not get out of its way");
  }
  const bool moved = part_[i.value] == Part::kMoving;
  if (part_[i.value] == Part::kUploading) --uploading_[core_.unit(i).bus];
  SetPart(i, Part::kNone);
  if (moved) GoOnLate(i);
}

bool ConfigurationExecutor::RoundIsOver() const {
  return late_.empty() &&
         std::all_of(parts_.begin(), parts_.end(),
                     [](std::uint32_t count) { return count == 0; }) &&
         std::none_of(plan_.moves.begin(), plan_.moves.end(),
                      [this](const UnitPlan& move) { return AwaitsStart(move.unit); });
}

void ConfigurationExecutor::ReportArrivals() {
  while (!arrivals_.empty() && core_.committed_through >= arrivals_.front().batch) {
    SetOutcome(arrivals_.front().unit, TargetOutcome::kArrived);
    arrivals_.pop_front();
  }
}

void ConfigurationExecutor::RoundOver() {
  if (view_.started != kNever && last_arrival_ > view_.started)
    view_.makespan_s += (last_arrival_ - view_.started).seconds();
  view_.started = kNever;
  if (state_ == State::kMoving) JudgeStarts();
  for (const UnitPlan& move : plan_.moves) plan_of_[move.unit.value] = kNoPlan;
  const bool was_homing = state_ == State::kHoming;
  plan_.moves.clear();
  courses_.clear();
  running_.reset();
  std::fill(goes_on_.begin(), goes_on_.end(), std::uint8_t{0});
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

void ConfigurationExecutor::JudgeTargets() {
  if (std::exchange(goes_past_, false)) {
    Gather();
    return;
  }
  bool again = false;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    const UnitView& view = core_.units[n].view;
    if (view.outcome != TargetOutcome::kPending) continue;
    if (IsPlace(view.knowledge) && targets_[n] && PlaceOf(view.knowledge) == *targets_[n]) {
      const bool noted = std::any_of(arrivals_.begin(), arrivals_.end(),
                                     [&](const Arrival& a) { return a.unit.value == n; });
      // It stood there from the start, or waits and will be here until the camera has looked.
      if (!noted) arrivals_.push_back({Waits({n}) ? settled_batch_ : 0, {n}});
    } else {
      again = true;
    }
  }
  if (again || AnotherWave()) return Gather();
  NoteWhoHasNoRoom();
  MeasureOrFinish();
}

void ConfigurationExecutor::FinishWhenDurable(ConfigurationState end) {
  end_ = end;
  due_ = core_.now;
  SetState(State::kReporting);
}

void ConfigurationExecutor::Strike(PositionerIndex i, const std::string& reason) {
  if (strikes_[i.value]++ < kStrikesMax) return;
  SetOutcome(i, TargetOutcome::kFailed, reason);
  Exclude(i);
}

void ConfigurationExecutor::Exclude(PositionerIndex i) { excluded_[i.value] = 1; }

void ConfigurationExecutor::Finish() {
  const bool stopped = end_ == ConfigurationState::kStopped;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n) {
    part_[n] = Part::kNone;
    plan_of_[n] = kNoPlan;
    if (core_.units[n].view.outcome == TargetOutcome::kPending)
      SetOutcome({n}, stopped ? TargetOutcome::kStopped : TargetOutcome::kFailed,
                 failure_.empty() ? "did not arrive" : failure_);
  }
  JudgeMeasured();
  parts_ = {};
  plan_ = {};
  late_.clear();
  courses_.clear();
  running_.reset();
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

void ConfigurationExecutor::SetOutcome(PositionerIndex i, TargetOutcome outcome,
                                       std::string reason) {
  UnitView& view = core_.unit(i).view;
  if (view.outcome == outcome) return;
  // An arrival or a failure is only taken back by a new goal.
  if (outcome != TargetOutcome::kPending && view.outcome != TargetOutcome::kPending) return;
  view.outcome = outcome;
  view.outcome_reason = std::move(reason);
  if (std::uint32_t* const count = CountOf(outcome)) ++*count;
  core_.Changed(i);
}

/// Where targets of this outcome are counted; null: nowhere.
std::uint32_t* ConfigurationExecutor::CountOf(TargetOutcome outcome) {
  switch (outcome) {
    case TargetOutcome::kArrived:
      return &view_.arrived;
    case TargetOutcome::kRefused:
      return &view_.refused;
    case TargetOutcome::kFailed:
      return &view_.failed;
    case TargetOutcome::kStopped:
      return &view_.stopped;
    case TargetOutcome::kUnmeasured:
      return &view_.unmeasured;
    case TargetOutcome::kNone:
    case TargetOutcome::kPending:
      break;
  }
  return nullptr;
}

void ConfigurationExecutor::SetPart(PositionerIndex i, Part part) {
  Part& mine = part_[i.value];
  if (mine != Part::kNone) --parts_[static_cast<std::size_t>(mine)];
  if (part != Part::kNone) ++parts_[static_cast<std::size_t>(part)];
  mine = part;
}

void ConfigurationExecutor::SetState(State state) { state_ = state; }

void ConfigurationExecutor::Record() {
  constexpr double kNotKnown = std::numeric_limits<double>::quiet_NaN();
  const bool known = view_.starts.reported > 0;
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
                              .peak_power_W = view_.peak_power_W,
                              .start_skew_s = known ? view_.starts.skew_s : kNotKnown,
                              .start_skew_bound_s = known ? view_.starts.bound_s : kNotKnown,
                              .stopped = view_.stopped,
                              .unmeasured = view_.unmeasured});
}

}  // namespace focalfleet
