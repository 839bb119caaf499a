// ConfigurationExecutor, while others move: single units that get another target, or go on after
// they were stopped, as late moves of the round under way.
//
//   settling -> planning -> uploading -> committing -> starting -> (moves like everybody else)
//      ^            |           |            |            |
//      +------------+-----------+------------+------------+   somebody near is not where the plan
//                                                             thinks, or it would start too late
//
// A late move has an id and a start instant of its own, fixed when it is planned; nobody else is
// told anything. Who cannot be served so keeps its target for the next round, unless an operator
// waits for the answer.

#include <algorithm>
#include <utility>

#include "fleet/coordinate/executor.h"
#include "fleet/coordinate/stall_detection.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

constexpr int kTriesMax = 3;          // of one late move
constexpr int kGoesOnMax = 2;         // times that a unit is taken up again in one round
constexpr int kStartsAsLate = 3;      // times that the start is said
constexpr std::size_t kLateMax = 64;  // at a time; the others wait for the next round

bool IsSame(const Deviation& a, const Deviation& b) {
  if (a.unit != b.unit || a.goes.has_value() != b.goes.has_value()) return false;
  return a.goes ? a.goes->start_s == b.goes->start_s && a.goes->move.to == b.goes->move.to
                : a.stands == b.stands;
}

bool IsWhere(const UnitKnowledge& knows, const UnitKnowledge& expected) {
  if (!IsPlace(knows) || !IsPlace(expected)) return knows == expected;
  return PlaceOf(knows) == PlaceOf(expected);
}

std::string InSeconds(DurationNs time) {
  const auto tenths = (time.ns + 50'000'000) / 100'000'000;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

}  // namespace

// ---- who

ConfigurationExecutor::Late* ConfigurationExecutor::FindLate(PositionerIndex i) {
  const auto it =
      std::find_if(late_.begin(), late_.end(), [i](const Late& late) { return late.unit == i; });
  return it == late_.end() ? nullptr : &*it;
}

MoveId ConfigurationExecutor::MoveOf(PositionerIndex i) const {
  const auto course = courses_.find(i.value);
  return course == courses_.end() ? move_ : course->second.move;
}

HostInstant ConfigurationExecutor::BeganOf(PositionerIndex i) const {
  const auto course = courses_.find(i.value);
  return course == courses_.end() ? view_.started : AtPlanTime(course->second.late.start_s);
}

/// Where it is otherwise than the plan of this round has it.
std::optional<Deviation> ConfigurationExecutor::DeviationOf(PositionerIndex i) const {
  const UnitRecord& unit = core_.units[i.value];
  const auto course = courses_.find(i.value);
  const Part part = part_[i.value];
  const bool as_planned = part == Part::kMoving && unit.view.phase == kMoving && unit.runs_freely;
  const bool to_start = part != Part::kMoving && part != Part::kNone;
  if (course != courses_.end()) {
    const LateMove& late = course->second.late;
    if (as_planned || to_start ||
        IsWhere(unit.view.knowledge, Exactly(Witness::kReported, late.move.to)))
      return Deviation{i, {}, late};
  } else if (as_planned || IsWhere(unit.view.knowledge, running_->PlannedEnd(i))) {
    return std::nullopt;
  }
  return Deviation{i, unit.view.knowledge, std::nullopt};
}

std::vector<Deviation> ConfigurationExecutor::Deviations() const {
  std::vector<Deviation> deviations;
  for (std::uint32_t n = 0; n < core_.units.size(); ++n)
    if (auto deviation = DeviationOf({n})) deviations.push_back(std::move(*deviation));
  return deviations;
}

std::vector<Deviation> ConfigurationExecutor::DeviationsNear(PositionerIndex i) const {
  std::vector<Deviation> near;
  for (const PositionerIndex j : core_.layout.neighbours(i))
    if (auto deviation = DeviationOf(j)) near.push_back(std::move(*deviation));
  return near;
}

/// Somebody who would have to stop this one has not been heard for too long.
bool ConfigurationExecutor::IsUnheard(const LateMove& late) const {
  return std::any_of(late.leaders.begin(), late.leaders.end(), [&](const LateMove::Leader& leader) {
    const UnitRecord& unit = core_.units[leader.unit.value];
    return unit.view.phase == kMoving && unit.question && unit.question->asked != kNever &&
           core_.now >= unit.question->asked + StallDetectionOf(core_.config).suspicion;
  });
}

/// It may be read anew while its way is planned (a late answer, a restart).
bool ConfigurationExecutor::StandsAt(PositionerIndex i, const Pose& from) const {
  const UnitView& view = core_.unit(i).view;
  return view.phase == kReady && IsPlace(view.knowledge) && PlaceOf(view.knowledge) == from;
}

bool ConfigurationExecutor::IsStale(const Late& late) const {
  const std::vector<Deviation> now = DeviationsNear(late.unit);
  return !std::equal(now.begin(), now.end(), late.near.begin(), late.near.end(), IsSame);
}

// ---- a new target

Status ConfigurationExecutor::MayRetarget(const RetargetCommand& command) {
  const PositionerIndex i = command.unit;
  const UnitView& view = core_.unit(i).view;
  if (!busy()) return Fail(ErrorCode::kRefused, "no configuration is under way: apply one");
  if (state_ != State::kMoving || stopping_ || running_ == nullptr)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(view_.id) +
                                         " is not moving now: try again in a moment");
  if (core_.store_failing)
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (!view.enabled)
    return Fail(ErrorCode::kRefused, core_.NameOf(i) + " is disabled: " + view.disabled_reason);
  if (FindLate(i) != nullptr)
    return Fail(ErrorCode::kRefused, core_.NameOf(i) + " is about to start: try again in a moment");
  if (late_.size() == kLateMax)
    return Fail(ErrorCode::kRefused, "too many units are about to start: try again in a moment");
  const bool moves = part_[i.value] == Part::kMoving && view.phase == kMoving;
  if (!moves && view.phase != kReady)
    return Fail(ErrorCode::kRefused, core_.NameOf(i) + " cannot go: it " + core_.TroubleOf(i));
  if (!moves && !IsPlace(view.knowledge))
    return Fail(ErrorCode::kRefused, "the place of " + core_.NameOf(i) + " " + core_.WhyNoPlace(i));
  // Before it is stopped for nothing.
  const double now_s = (core_.now - view_.started).seconds();
  return running_->CheckTarget({.unit = i,
                                .from = command.target,
                                .to = command.target,
                                .now_s = now_s,
                                .start_s = std::max(0.0, now_s)},
                               Deviations());
}

Status ConfigurationExecutor::Retarget(std::uint64_t request, const RetargetCommand& command) {
  FOCALFLEET_TRY(MayRetarget(command));
  const PositionerIndex i = command.unit;
  UnitView& view = core_.unit(i).view;
  if (!targets_[i.value]) ++view_.targeted;
  if (std::uint32_t* const count = CountOf(view.outcome)) --*count;
  std::erase_if(arrivals_, [i](const Arrival& arrival) { return arrival.unit == i; });
  targets_[i.value] = goals_[i.value] = view.target = command.target;
  approaches_[i.value].reset();                            // of a correction to the other target
  if (!target_ids_.empty()) target_ids_[i.value].clear();  // the name was the other target's
  view.outcome = TargetOutcome::kPending;
  view.outcome_reason.clear();
  excluded_[i.value] = 0;
  strikes_[i.value] = 0;
  core_.Changed(i);
  core_.Raise(Severity::kInfo, i, {}, core_.NameOf(i) + " gets another target");
  if (part_[i.value] == Part::kMoving) {
    StopFollowers(i, {core_.now, core_.now + core_.Patience()},
                  core_.NameOf(i) + " gets another target and may stand in its way");
    StopOne(i, "it gets another target");
  }
  late_.push_back({.unit = i, .request = request, .near = {}});
  core_.out->replies.push_back({request, false, {}, core_.NameOf(i) + " gets another target"});
  return {};
}

/// Stopped on its way, and still wanted there; who runs up is not there yet, and stays.
void ConfigurationExecutor::GoOnLate(PositionerIndex i) {
  const UnitView& view = core_.unit(i).view;
  if (goes_past_) return;
  if (state_ != State::kMoving || stopping_ || running_ == nullptr || !targets_[i.value]) return;
  if (view.outcome != TargetOutcome::kPending || excluded_[i.value] != 0) return;
  if (!IsPlace(view.knowledge) || PlaceOf(view.knowledge) == *targets_[i.value]) return;
  if (FindLate(i) != nullptr || late_.size() == kLateMax || goes_on_[i.value] == kGoesOnMax) return;
  ++goes_on_[i.value];
  late_.push_back({.unit = i, .near = {}});
}

void ConfigurationExecutor::EndLate(const Late& late, Error error) {
  if (late.request != 0) core_.out->replies.push_back({late.request, true, std::move(error), {}});
}

// ---- from the stop to the start

void ConfigurationExecutor::AdvanceLate() {
  late_due_ = kNever;
  for (std::size_t n = 0; n < late_.size();) {
    if (AdvanceOne(&late_[n]))
      ++n;
    else
      late_.erase(late_.begin() + static_cast<std::ptrdiff_t>(n));
  }
}

bool ConfigurationExecutor::AdvanceOne(Late* late) {
  switch (late->stage) {
    case Late::Stage::kSettling:
      return Settle(late);
    case Late::Stage::kPlanning:
      PlanLate(late);
      return true;
    case Late::Stage::kUploading:
    case Late::Stage::kCommitting:
    case Late::Stage::kStarting:
      return Load(late);
    case Late::Stage::kStarted:
      SayStart(late);
      return late->starts_said < kStartsAsLate;
  }
  return false;
}

/// It stands, and so does everybody who was stopped with it.
bool ConfigurationExecutor::Settle(Late* late) {
  const PositionerIndex i = late->unit;
  const UnitView& view = core_.unit(i).view;
  if (part_[i.value] != Part::kNone || view.phase == kIdentifying) return true;
  if (view.phase != kReady || !IsPlace(view.knowledge)) {
    EndLate(*late, {ErrorCode::kUnavailable,
                    view.phase == kReady ? core_.NameOf(i) + ": its position is not known any more"
                                         : core_.NameOf(i) + " " + core_.TroubleOf(i)});
    return false;
  }
  const bool others_stop =
      std::any_of(core_.units.begin(), core_.units.end(), [](const UnitRecord& unit) {
        return unit.view.phase == kMoving && unit.question &&
               std::holds_alternative<Stop>(unit.question->message);
      });
  if (others_stop) return true;
  late->stage = Late::Stage::kPlanning;
  PlanLate(late);
  return true;
}

/// One job at a time.
void ConfigurationExecutor::PlanLate(Late* late) {
  if (late_job_ != 0) return;
  const PositionerIndex i = late->unit;
  // Upload, read-back and arming take some answers' time, the store some more; then the start.
  const DurationNs lead =
      core_.config.start_delay +
      std::max(Milliseconds(500), core_.config.reply_wait * 10) * (std::int64_t{1} << late->tries);
  const HostInstant start = std::max(core_.now, view_.started) + lead;
  late_job_ = ++job_;
  late->job = late_job_;
  late->near = DeviationsNear(i);
  PlanJob job{.job = job_, .start = {}, .targets = {}, .frozen = {}, .options = {}, .to_home = {}};
  const ReplanQuestion question{
      .unit = i,
      .from = PlaceOf(core_.unit(i).view.knowledge),
      .to = *targets_[i.value],
      .now_s = (core_.now - view_.started).seconds(),
      .start_s = (start - view_.started).seconds(),
      .start_skew_s = std::max(ReplanQuestion{}.start_skew_s, 2 * planned_skew_s_)};
  job.late = std::make_shared<const LateJob>(LateJob{running_, question, Deviations()});
  core_.out->plan_job = std::move(job);
}

void ConfigurationExecutor::OnLatePlan(const PlanDone& done) {
  if (done.job == late_job_) late_job_ = 0;
  const auto late = std::find_if(late_.begin(), late_.end(),
                                 [&](const Late& other) { return other.job == done.job; });
  if (late == late_.end() || late->stage != Late::Stage::kPlanning) return;
  if (!*done.late) {
    const Error& error = done.late->error();
    if (late->request != 0) SetOutcome(late->unit, TargetOutcome::kRefused, error.text);
    EndLate(*late, error);
    late_.erase(late);
  } else if (!StandsAt(late->unit, (*done.late)->move.from) || IsStale(*late)) {
    if (!TryAgain(&*late)) late_.erase(late);
  } else {
    late->predicted = done.predicted;
    TakeLate(&*late, **done.late);
  }
}

/// False: it was tried often enough; the next round may serve it.
bool ConfigurationExecutor::TryAgain(Late* late) {
  late->stage = Late::Stage::kSettling;
  if (++late->tries < kTriesMax) return true;
  EndLate(*late, {ErrorCode::kRefused, core_.NameOf(late->unit) +
                                           " does not get off while others move: it goes in the "
                                           "next round"});
  return false;
}

void ConfigurationExecutor::TakeLate(Late* late, const LateMove& move) {
  const PositionerIndex i = late->unit;
  courses_[i.value] = {move, core_.TakeMoveId()};
  plan_of_[i.value] = plan_.moves.size();
  plan_.moves.push_back(move.move);
  stage_tries_[i.value] = 0;
  late->stage = Late::Stage::kUploading;
  SetPart(i, Part::kWaiting);
  core_.SetPhase(i, kStaging);
  ReportOtherLate(i);
  // Watched from now on: who has ended already is noticed before this one starts.
  for (const LateMove::Leader& leader : move.leaders) {
    const PositionerIndex j = leader.unit;
    if (part_[j.value] == Part::kNone || plan_of_[j.value] == kNoPlan) continue;
    plan_.moves[plan_of_[j.value]].followers.push_back(leader.follower);
    // One that is late itself is watched from its own start on.
    if (part_[j.value] == Part::kMoving) WatchSoon(j);
  }
  Upload(i);
}

/// This one was planned around those that are to start, so to them it is no news that it goes.
void ConfigurationExecutor::ReportOtherLate(PositionerIndex i) {
  const std::optional<Deviation> deviation = DeviationOf(i);
  for (Late& other : late_) {
    const auto near = core_.layout.neighbours(other.unit);
    if (other.unit == i || !IsLoaded(core_.unit(other.unit).view.phase) ||
        !std::binary_search(near.begin(), near.end(), i))
      continue;
    std::erase_if(other.near, [i](const Deviation& known) { return known.unit == i; });
    const auto place = std::find_if(other.near.begin(), other.near.end(),
                                    [i](const Deviation& known) { return i < known.unit; });
    if (deviation) other.near.insert(place, *deviation);
  }
}

/// The unit gives its move back. Who was to come where it stands, and has started, is stopped.
void ConfigurationExecutor::Withdraw(PositionerIndex i) {
  StopFollowers(i, {HostInstant{INT64_MIN}, kNever}, core_.NameOf(i) + " stays in its way");
  TakeBackIntent(i);
  courses_.erase(i.value);
  plan_of_[i.value] = kNoPlan;
  if (!IsLoaded(core_.unit(i).view.phase)) return;
  core_.Forget(i);
  core_.Ask(i, Stop{});
}

/// From the upload to the start; false: it is over with it.
bool ConfigurationExecutor::Load(Late* late) {
  const PositionerIndex i = late->unit;
  if (part_[i.value] == Part::kNone) {  // fell out; who it was and why is said already
    StopFollowers(i, {HostInstant{INT64_MIN}, kNever}, core_.NameOf(i) + " stays in its way");
    before_[i.value].reset();
    courses_.erase(i.value);
    plan_of_[i.value] = kNoPlan;
    EndLate(*late, {ErrorCode::kUnavailable, core_.NameOf(i) + " did not take its move"});
    return false;
  }
  const HostInstant start = BeganOf(i);
  const HostInstant last = start - DurationNs{core_.config.start_delay.ns / 2};
  if (core_.now > last || IsStale(*late) || IsUnheard(courses_.at(i.value).late)) {
    Withdraw(i);
    return TryAgain(late);
  }
  late_due_ = std::min(late_due_, last + DurationNs{1});
  if (part_[i.value] != Part::kHolding) return true;
  if (late->stage == Late::Stage::kUploading) {
    Intend(i, IntentOf(i), core_.unit(i).view.offset);
    late->batch = core_.batch_now();
    late->stage = Late::Stage::kCommitting;
  }
  if (late->stage == Late::Stage::kCommitting && core_.committed_through >= late->batch)
    late->stage = Late::Stage::kStarting;
  if (late->stage != Late::Stage::kStarting) return true;
  if (core_.now >= start - core_.config.start_delay) {
    StartLate(late);
    return true;
  }
  late_due_ = std::min(late_due_, start - core_.config.start_delay);
  return true;
}

void ConfigurationExecutor::StartLate(Late* late) {
  const PositionerIndex i = late->unit;
  const LateMove& move = courses_.at(i.value).late;
  SetPart(i, Part::kMoving);
  core_.SetPhase(i, kMoving);
  before_[i.value].reset();
  core_.unit(i).seen_moving = HostInstant{INT64_MIN};
  core_.unit(i).view.error_um.reset();
  WatchLeader(i);
  core_.SetDue(i, core_.unit(i).next_poll);
  view_.energy_J += late->predicted.energy_J;
  view_.makespan_predicted_s += std::max(0.0, move.end_s - round_end_s_);
  round_end_s_ = std::max(round_end_s_, move.end_s);
  if (late->request != 0)
    core_.out->replies.push_back({late->request,
                                  true,
                                  {},
                                  core_.NameOf(i) + " goes to its new target and is there in " +
                                      InSeconds(AtPlanTime(move.end_s) - core_.now)});
  late->stage = Late::Stage::kStarted;
  SayStart(late);
}

void ConfigurationExecutor::SayStart(Late* late) {
  if (core_.now < late->say_start_at) {
    late_due_ = std::min(late_due_, late->say_start_at);
    return;
  }
  const DurationNs left = BeganOf(late->unit) - core_.now;
  const auto ticks = static_cast<std::uint32_t>(std::max<std::int64_t>(left.ns, 0) / kTick.ns);
  core_.SendNow(core_.unit(late->unit).bus, focalfleet::Start{MoveOf(late->unit), ticks},
                kBroadcastNode);
  ++late->starts_said;
  late->say_start_at = core_.now + DurationNs{core_.config.start_delay.ns / (kStartsAsLate + 1)};
  late_due_ = std::min(late_due_, late->say_start_at);
}

/// Nobody goes any more who has not started.
void ConfigurationExecutor::EndAllLate(const std::string& reason) {
  for (const Late& late : late_) {
    if (late.stage == Late::Stage::kStarted) continue;
    EndLate(late, {ErrorCode::kRefused, core_.NameOf(late.unit) + " does not go: " + reason});
    Withdraw(late.unit);
  }
  late_.clear();
  late_job_ = 0;
}

}  // namespace focalfleet
