#include "fleet/coordinate/late_moves.h"

#include <algorithm>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>
#include <variant>

#include "fleet/coordinate/deviations.h"
#include "fleet/coordinate/intents.h"
#include "fleet/coordinate/stall_detection.h"
#include "fleet/coordinate/watch.h"

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

std::string InSeconds(DurationNs time) {
  const auto tenths = (time.ns + 50'000'000) / 100'000'000;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " s";
}

/// True where a unit whose end would have to stop this one has not been heard for too long.
bool IsUnheard(const Coordination& fleet, const LateMove& late) {
  return std::any_of(late.leaders.begin(), late.leaders.end(), [&](const LateMove::Leader& leader) {
    const UnitRecord& unit = fleet.units[leader.unit];
    const std::optional<Question>& question = unit.request.question;
    return unit.view.phase == kMoving && question && question->asked != kNever &&
           fleet.now() >= question->asked + StallDetectionOf(fleet.config).suspicion;
  });
}

/// The unit may be read anew while its way is planned (a late answer, a restart).
bool StandsAt(const UnitView& view, const Pose& from) {
  return view.phase == kReady && IsPlace(view.knowledge) && PlaceOf(view.knowledge) == from;
}

bool IsBeingStopped(const UnitRecord& unit) {
  return unit.view.phase == kMoving && unit.request.question &&
         std::holds_alternative<Stop>(unit.request.question->message);
}

}  // namespace

LateMoves::LateMoves(const Coordination& fleet, Configuration* configuration, Round* round,
                     Upload* upload)
    : fleet_(fleet), configuration_(*configuration), round_(*round), upload_(*upload) {}

const LateMoves::Move* LateMoves::Find(PositionerIndex i) const {
  const auto it =
      std::find_if(moves_.begin(), moves_.end(), [i](const Move& late) { return late.unit == i; });
  return it == moves_.end() ? nullptr : &*it;
}

bool LateMoves::IsStale(const Move& late) const {
  const std::vector<Deviation> now = DeviationsNear(fleet_, round_, late.unit);
  return !std::equal(now.begin(), now.end(), late.near.begin(), late.near.end(), IsSame);
}

// ---- a new target

Status LateMoves::MayRetarget(const RetargetCommand& command) const {
  const PositionerIndex i = command.unit;
  const UnitTable& units = fleet_.units;
  const UnitView& view = units[i].view;
  if (!configuration_.busy())
    return Fail(ErrorCode::kRefused, "no configuration is under way: apply one");
  if (configuration_.phase() != ConfigurationPhase::kMoving || configuration_.stopping ||
      round_.running == nullptr)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(configuration_.view.id) +
                                         " is not moving now: try again in a moment");
  if (fleet_.ledger.store_failing())
    return Fail(ErrorCode::kRefused, "the store cannot be written: nothing moves until it can");
  if (!view.enabled)
    return Fail(ErrorCode::kRefused, units.NameOf(i) + " is disabled: " + view.disabled_reason);
  if (Find(i) != nullptr)
    return Fail(ErrorCode::kRefused, units.NameOf(i) + " is about to start: try again in a moment");
  if (moves_.size() == kLateMax)
    return Fail(ErrorCode::kRefused, "too many units are about to start: try again in a moment");
  const bool moves = round_.part(i) == Part::kMoving && view.phase == kMoving;
  if (!moves && view.phase != kReady)
    return Fail(ErrorCode::kRefused, units.NameOf(i) + " cannot go: it " + units.TroubleOf(i));
  if (!moves && !IsPlace(view.knowledge))
    return Fail(ErrorCode::kRefused, "the place of " + units.NameOf(i) + " " + units.WhyNoPlace(i));
  // The target is checked before the unit is stopped for nothing.
  const double now_s = (fleet_.now() - round_.started).seconds();
  return round_.running->CheckTarget({.unit = i,
                                      .from = command.target,
                                      .to = command.target,
                                      .now_s = now_s,
                                      .start_s = std::max(0.0, now_s)},
                                     Deviations(fleet_, round_));
}

void LateMoves::Add(PositionerIndex i, std::uint64_t request) {
  moves_.push_back({.unit = i, .request = request, .near = {}});
}

void LateMoves::GoOn(PositionerIndex i) {
  const UnitView& view = fleet_.units[i].view;
  const ConfigurationUnit& unit = configuration_[i];
  if (configuration_.phase() != ConfigurationPhase::kMoving || configuration_.stopping ||
      round_.running == nullptr || !unit.target)
    return;
  if (view.outcome != TargetOutcome::kPending || unit.excluded) return;
  if (!IsPlace(view.knowledge) || PlaceOf(view.knowledge) == *unit.target) return;
  if (Find(i) != nullptr || moves_.size() == kLateMax || round_[i].goes_on == kGoesOnMax) return;
  ++round_[i].goes_on;
  Add(i, 0);
}

void LateMoves::Reply(const Move& late, Error error) const {
  if (late.request != 0) fleet_.out().replies.push_back({late.request, true, std::move(error), {}});
}

// ---- from the stop to the start

void LateMoves::Advance() {
  due_ = kNever;
  for (std::size_t n = 0; n < moves_.size();) {
    if (AdvanceOne(&moves_[n]))
      ++n;
    else
      moves_.erase(moves_.begin() + static_cast<std::ptrdiff_t>(n));
  }
}

bool LateMoves::AdvanceOne(Move* late) {
  switch (late->stage) {
    case Move::Stage::kSettling:
      return Settle(late);
    case Move::Stage::kPlanning:
      AskForPlan(late);
      return true;
    case Move::Stage::kUploading:
    case Move::Stage::kCommitting:
    case Move::Stage::kStarting:
      return Load(late);
    case Move::Stage::kStarted:
      SayStart(late);
      return late->starts_said < kStartsAsLate;
  }
  return false;
}

/// The unit stands, and so do all units that were stopped with it.
bool LateMoves::Settle(Move* late) {
  const PositionerIndex i = late->unit;
  const UnitView& view = fleet_.units[i].view;
  if (round_.part(i) != Part::kNone || view.phase == kIdentifying) return true;
  if (view.phase != kReady || !IsPlace(view.knowledge)) {
    const std::string name = fleet_.units.NameOf(i);
    Reply(*late, {ErrorCode::kUnavailable, view.phase == kReady
                                               ? name + ": its position is not known any more"
                                               : name + " " + fleet_.units.TroubleOf(i)});
    return false;
  }
  if (std::ranges::any_of(fleet_.units.all(), IsBeingStopped)) return true;
  late->stage = Move::Stage::kPlanning;
  AskForPlan(late);
  return true;
}

/// Asks for a plan, one job at a time.
void LateMoves::AskForPlan(Move* late) {
  if (job_ != 0) return;
  const PositionerIndex i = late->unit;
  // Upload, read-back and arming take some answers' time, the store some more; then the start.
  const DurationNs lead =
      fleet_.config.start_delay +
      std::max(Milliseconds(500), fleet_.config.reply_wait * 10) * (std::int64_t{1} << late->tries);
  const HostInstant start = std::max(fleet_.now(), round_.started) + lead;
  job_ = ++round_.job;
  late->job = job_;
  late->near = DeviationsNear(fleet_, round_, i);
  PlanJob job{.job = job_, .start = {}, .targets = {}, .frozen = {}, .options = {}, .to_home = {}};
  const ReplanQuestion question{
      .unit = i,
      .from = PlaceOf(fleet_.units[i].view.knowledge),
      .to = *configuration_[i].target,
      .now_s = (fleet_.now() - round_.started).seconds(),
      .start_s = (start - round_.started).seconds(),
      .start_skew_s = std::max(ReplanQuestion{}.start_skew_s, 2 * round_.next_skew_s)};
  job.late = std::make_shared<const LateJob>(
      LateJob{round_.running, question, Deviations(fleet_, round_)});
  fleet_.out().plan_job = std::move(job);
}

void LateMoves::OnPlan(const PlanDone& done) {
  if (done.job == job_) job_ = 0;
  const auto late = std::find_if(moves_.begin(), moves_.end(),
                                 [&](const Move& other) { return other.job == done.job; });
  if (late == moves_.end() || late->stage != Move::Stage::kPlanning) return;
  if (!*done.late) {
    const Error& error = done.late->error();
    if (late->request != 0)
      configuration_.outcomes.Set(late->unit, TargetOutcome::kRefused, error.text);
    Reply(*late, error);
    moves_.erase(late);
  } else if (!StandsAt(fleet_.units[late->unit].view, (*done.late)->move.from) || IsStale(*late)) {
    if (!TryAgain(&*late)) moves_.erase(late);
  } else {
    late->predicted = done.predicted;
    TakePlan(&*late, **done.late);
  }
}

/// False: it was tried often enough; the next round may serve it.
bool LateMoves::TryAgain(Move* late) {
  late->stage = Move::Stage::kSettling;
  if (++late->tries < kTriesMax) return true;
  Reply(*late, {ErrorCode::kRefused, fleet_.units.NameOf(late->unit) +
                                         " does not get off while others move: it goes in the "
                                         "next round"});
  return false;
}

void LateMoves::TakePlan(Move* late, const LateMove& move) {
  const PositionerIndex i = late->unit;
  round_.AddLate(i, move, fleet_.ledger.TakeMoveId());
  late->stage = Move::Stage::kUploading;
  round_.SetPart(i, Part::kWaiting);
  fleet_.units.SetPhase(i, kStaging);
  ReportOther(i);
  // The leaders are watched from now on: one that has ended already is noticed before this one
  // starts.
  for (const LateMove::Leader& leader : move.leaders) {
    const PositionerIndex j = leader.unit;
    UnitPlan* const plan = round_.PlanOf(j);
    if (round_.part(j) == Part::kNone || plan == nullptr) continue;
    plan->followers.push_back(leader.follower);
    // A leader that is late itself is watched from its own start on.
    if (round_.part(j) == Part::kMoving) WatchSoon(fleet_, round_, j);
  }
  upload_.Send(i);
}

/// Brings the deviations up to date that other late moves were planned with. This move was planned
/// around those that are about to start, so it makes none of them stale.
void LateMoves::ReportOther(PositionerIndex i) {
  const std::optional<Deviation> deviation = DeviationOf(fleet_, round_, i);
  for (Move& other : moves_) {
    const auto near = fleet_.layout.neighbours(other.unit);
    if (other.unit == i || !IsLoaded(fleet_.units[other.unit].view.phase) ||
        !std::binary_search(near.begin(), near.end(), i))
      continue;
    std::erase_if(other.near, [i](const Deviation& known) { return known.unit == i; });
    const auto place = std::find_if(other.near.begin(), other.near.end(),
                                    [i](const Deviation& known) { return i < known.unit; });
    if (deviation) other.near.insert(place, *deviation);
  }
}

/// The unit gives its move back. Units that have started and were to come where it stands are
/// stopped.
void LateMoves::Withdraw(PositionerIndex i) {
  StopFollowers(fleet_, round_, i, {HostInstant{INT64_MIN}, kNever},
                fleet_.units.NameOf(i) + " stays in its way");
  TakeBackIntent(fleet_, i, &round_);
  round_.DropLate(i);
  if (!IsLoaded(fleet_.units[i].view.phase)) return;
  fleet_.requests.Forget(i);
  fleet_.requests.Ask(i, focalfleet::Stop{});
}

/// True where the move has to be given back. Reasons: too late for the start, a neighbour that has
/// moved since the plan was made, a leader that is not heard.
bool LateMoves::MustNotStart(const Move& late, HostInstant last) const {
  return fleet_.now() > last || IsStale(late) || IsUnheard(fleet_, *round_.LateOf(late.unit));
}

/// From the upload to the start.
bool LateMoves::Load(Move* late) {
  const PositionerIndex i = late->unit;
  if (round_.part(i) == Part::kNone) {  // it failed, and an alarm has said why
    StopFollowers(fleet_, round_, i, {HostInstant{INT64_MIN}, kNever},
                  fleet_.units.NameOf(i) + " stays in its way");
    round_[i].before.reset();
    round_.DropLate(i);
    Reply(*late, {ErrorCode::kUnavailable, fleet_.units.NameOf(i) + " did not take its move"});
    return false;
  }
  const HostInstant start = round_.BeganOf(i);
  const HostInstant last = start - DurationNs{fleet_.config.start_delay.ns / 2};
  if (MustNotStart(*late, last)) {
    Withdraw(i);
    return TryAgain(late);
  }
  due_ = std::min(due_, last + DurationNs{1});
  if (round_.part(i) != Part::kHolding) return true;
  if (late->stage == Move::Stage::kUploading) {
    Intend(fleet_, IntentOf(fleet_, round_, configuration_.view.id, i), fleet_.units[i].view.offset,
           i, &round_);
    late->batch = fleet_.ledger.batch_now();
    late->stage = Move::Stage::kCommitting;
  }
  if (late->stage == Move::Stage::kCommitting && fleet_.ledger.committed_through() >= late->batch)
    late->stage = Move::Stage::kStarting;
  if (late->stage != Move::Stage::kStarting) return true;
  if (fleet_.now() >= start - fleet_.config.start_delay) {
    Start(late);
    return true;
  }
  due_ = std::min(due_, start - fleet_.config.start_delay);
  return true;
}

void LateMoves::Start(Move* late) {
  const PositionerIndex i = late->unit;
  const LateMove& move = *round_.LateOf(i);
  UnitRecord& unit = fleet_.units[i];
  round_.SetPart(i, Part::kMoving);
  fleet_.units.SetPhase(i, kMoving);
  round_[i].before.reset();
  unit.motion.seen_moving = HostInstant{INT64_MIN};
  unit.view.error_um.reset();
  WatchFromStart(fleet_, round_, i);
  fleet_.timers.Set(i, unit.next_poll);
  configuration_.view.energy_J += late->predicted.energy_J;
  configuration_.view.makespan_predicted_s += std::max(0.0, move.end_s - round_.end_s);
  round_.end_s = std::max(round_.end_s, move.end_s);
  if (late->request != 0)
    fleet_.out().replies.push_back({late->request,
                                    true,
                                    {},
                                    fleet_.units.NameOf(i) +
                                        " goes to its new target and is there in " +
                                        InSeconds(round_.AtPlanTime(move.end_s) - fleet_.now())});
  late->stage = Move::Stage::kStarted;
  SayStart(late);
}

void LateMoves::SayStart(Move* late) {
  if (fleet_.now() < late->say_start_at) {
    due_ = std::min(due_, late->say_start_at);
    return;
  }
  const PositionerIndex i = late->unit;
  const DurationNs left = round_.BeganOf(i) - fleet_.now();
  if (left <= DurationNs{0}) {  // the host was held up: a later begin would not be the planned one
    late->starts_said = kStartsAsLate;
    return;
  }
  const auto ticks = static_cast<std::uint32_t>(left.ns / kTick.ns);
  fleet_.requests.SendNow(fleet_.units[i].bus, focalfleet::Start{round_.MoveOf(i), ticks},
                          kBroadcastNode);
  ++late->starts_said;
  late->say_start_at =
      fleet_.now() + DurationNs{fleet_.config.start_delay.ns / (kStartsAsLate + 1)};
  due_ = std::min(due_, late->say_start_at);
}

bool LateMoves::Stop(PositionerIndex i, const std::string& reason) {
  const Move* const late = Find(i);
  if (late == nullptr || late->stage == Move::Stage::kStarted) return false;
  Reply(*late, {ErrorCode::kRefused, fleet_.units.NameOf(i) + reason});
  Withdraw(i);
  std::erase_if(moves_, [i](const Move& other) { return other.unit == i; });
  return true;
}

void LateMoves::EndAll(const std::string& reason) {
  for (const Move& late : moves_) {
    if (late.stage == Move::Stage::kStarted) continue;
    Reply(late, {ErrorCode::kRefused, fleet_.units.NameOf(late.unit) + " does not go: " + reason});
    Withdraw(late.unit);
  }
  moves_.clear();
  job_ = 0;
}

}  // namespace focalfleet
