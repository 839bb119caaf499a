#include "fleet/coordinate/configuration_progress.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "fleet/coordinate/intents.h"
#include "fleet/coordinate/measured_outcomes.h"
#include "fleet/coordinate/round_job.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using enum UnitPhase;
using Phase = ConfigurationPhase;

constexpr DurationNs kGatherStep = Milliseconds(50);
constexpr DurationNs kSettleMost = Seconds(180);

/// The unit has not had the chance to answer, is being read, or is taking a parameter that plans
/// depend on.
bool IsAwaited(const UnitRecord& unit) {
  return unit.view.phase == kIdentifying || (unit.view.phase == kAbsent && !unit.asked_once) ||
         unit.view.phase == kSettling || unit.request.write_request != 0 ||
         !unit.request.waiting_writes.empty();
}

bool AwaitsStore(const UnitRecord& unit) {
  return unit.view.phase == kIdentifying && unit.reading.stored_by.has_value();
}

void SayWhatIsWaitedFor(ExecutorRooms* rooms) {
  const Coordination& fleet = rooms->fleet;
  Configuration& configuration = rooms->configuration;
  const Phase phase = configuration.phase();
  const bool needs_the_store = (phase == Phase::kGathering && !fleet.ledger.MovesAreReserved()) ||
                               std::ranges::any_of(fleet.units.all(), AwaitsStore) ||
                               phase == Phase::kCommitting || phase == Phase::kHomeCommitting ||
                               phase == Phase::kReporting;
  configuration.view.waiting_for =
      needs_the_store && fleet.ledger.store_failing() ? "the store, which cannot be written"
      : phase == Phase::kMeasuring && rooms->measurement.IsAsked() ? "the camera"
                                                                   : "";
}

}  // namespace

bool IsHeld(const ExecutorRooms& rooms) {
  const Phase phase = rooms.configuration.phase();
  if (rooms.fleet.ledger.committed_through() < rooms.round.commit_batch) return false;
  return phase == Phase::kHomeCommitting ||
         (phase == Phase::kCommitting &&
          rooms.round.count(Part::kHolding) == rooms.round.plan.moves.size());
}

void ConfigurationProgress::Begin(std::uint64_t request, const Goal& goal) {
  configuration_.Begin(request, goal);
  rooms_.corrections.Begin();
  rooms_.measurement.Begin();
  rooms_.homing.Begin(goal);
  sets_out_ = true;
  Gather();
  fleet_.out().replies.push_back(
      {request, false, {}, "configuration " + std::to_string(configuration_.view.id)});
}

void ConfigurationProgress::Gather() {
  gather_until_ = fleet_.now() + fleet_.config.silence_limit;
  configuration_.due = fleet_.now();
  configuration_.SetPhase(Phase::kGathering);
}

void ConfigurationProgress::GatherIfDue() {
  const bool waiting = std::ranges::any_of(fleet_.units.all(), IsAwaited);
  // In a plane others go on meanwhile: units that an earlier life of the daemon has sent off are
  // waited for as long as they may move.
  const bool settling = fleet_.config.in_plane && fleet_.now() < gather_until_ + kSettleMost &&
                        std::ranges::any_of(fleet_.units.all(), [](const UnitRecord& unit) {
                          return unit.view.phase == kSettling;
                        });
  if ((waiting && fleet_.now() < gather_until_) || settling || !fleet_.ledger.MovesAreReserved() ||
      std::ranges::any_of(fleet_.units.all(), AwaitsStore)) {
    configuration_.due = fleet_.now() + kGatherStep;
    return;
  }
  if (configuration_.view.kind == ConfigurationKind::kMeasure)
    return rooms_.measurement.Start(Look::kOnly);
  if (rooms_.measurement.LooksFirst()) return rooms_.measurement.Start(Look::kBefore);
  BeginRound();
}

// ---- planning

void ConfigurationProgress::BeginRound() {
  ConfigurationView& view = configuration_.view;
  // The plane bounds the rounds of its sectors.
  if (view.round == limits::kRoundsPerConfiguration && !fleet_.config.in_plane) {
    configuration_.failure = "gave up after " + std::to_string(view.round) + " rounds";
    configuration_.EndWhenDurable(ConfigurationState::kDone);
    return;
  }
  ++view.round;
  std::optional<PlanJob> job = JobOfRound(std::exchange(sets_out_, false), &rooms_);
  if (!job) {
    MeasureOrEnd();
    return;
  }
  fleet_.out().plan_job = std::move(*job);
  view.state = ConfigurationState::kPlanning;
  configuration_.SetPhase(Phase::kPlanning);
}

void ConfigurationProgress::OnPlan(const PlanDone& done) {
  if (done.late) return rooms_.late.OnPlan(done);
  // A plan of a configuration that was stopped is dropped.
  if (configuration_.phase() != Phase::kPlanning || done.job != round_.job) return;
  if (done.plan) return TakePlan(done);
  if (rooms_.corrections.goes_past()) {  // then the units come to their targets as they can
    fleet_.ledger.alarms().Raise(
        AlarmName::kNoRunUp, {}, {},
        "no run-up: from which side the targets are approached is left open (" +
            done.plan.error().text + ")");
    rooms_.corrections.GiveUpApproach();
    Gather();
    return;
  }
  configuration_.failure = done.plan.error().text;
  if (configuration_.view.round == 1) configuration_.ReplyLast(done.plan.error(), {});
  configuration_.outcomes.SetOfPending(TargetOutcome::kRefused, configuration_.failure);
  configuration_.EndWhenDurable(ConfigurationState::kFailed);
}

void ConfigurationProgress::TakeRound(const SectorRound& round) {
  round_.border = {
      .follows = round.follows, .leads = {}, .finished = round.finished, .end = round.end};
  for (const SectorRound::LeadsBeyond& leads : round.leads)
    round_.border.leads[leads.unit.value] = leads;
  round_.skew_s = round.start_skew_s;
  for (const SectorRound::Refused& refused : round.refused)
    if (fleet_.units[refused.unit].view.outcome == TargetOutcome::kPending)
      configuration_.outcomes.Set(refused.unit, TargetOutcome::kRefused, refused.reason);
  if (!round.failure.empty()) configuration_.failure = round.failure;
  PlanDone done{};
  done.job = round.job;
  done.plan = Plan{};
  done.plan->moves = round.moves;
  done.homing = round.homing;
  done.predicted = {round.makespan_s, round.energy_J, round.peak_power_W};
  TakePlan(done);
}

void ConfigurationProgress::Withdraw() {
  // An exposure is no use for a unit that has another target by now.
  const bool looks =
      configuration_.phase() == Phase::kMeasuring && rooms_.measurement.look() == Look::kAfter;
  if (configuration_.phase() == Phase::kPlanning || looks) return Gather();
  if (configuration_.phase() == Phase::kHomeCommitting) {
    TakeBackIntents(fleet_, &round_);
    return Gather();
  }
  if (configuration_.phase() != Phase::kUploading && configuration_.phase() != Phase::kCommitting)
    return;
  TakeBackIntents(fleet_, &round_);
  Disarm();
}

void ConfigurationProgress::TakePlan(const PlanDone& done) {
  round_.TakePlan(*done.plan);
  const Plan& plan = round_.plan;
  if (!plan.too_near.empty())
    fleet_.ledger.alarms().Raise(AlarmName::kUnitsTooNear, {}, {},
                                 plan.too_near + ": they may touch, and are led apart");
  rooms_.homing.SetWave(done.homing);
  round_.running = done.running;
  const bool stale = std::ranges::any_of(plan.moves, [&](const UnitPlan& move) {
    const UnitView& view = fleet_.units[move.unit].view;
    return view.phase != kReady || !IsPlace(view.knowledge) || PlaceOf(view.knowledge) != move.from;
  });
  if (stale) {  // a unit failed while the plan was made
    BeginRound();
    return;
  }
  for (const Unserved& unserved : plan.unserved)
    if (!rooms_.corrections.goes_past() &&
        fleet_.units[unserved.unit].view.outcome == TargetOutcome::kPending)
      configuration_.outcomes.Set(
          unserved.unit, TargetOutcome::kRefused,
          std::string(Name(unserved.why)) +
              (unserved.by ? " by " + fleet_.units.NameOf(*unserved.by) : ""));
  round_.prediction = done.predicted;
  round_.move = fleet_.ledger.TakeMoveId();
  if (plan.moves.empty()) {
    EndRound();
    return;
  }
  configuration_.view.state = ConfigurationState::kUploading;
  configuration_.SetPhase(Phase::kUploading);
  for (std::size_t n = 0; n < plan.moves.size(); ++n) {
    round_[plan.moves[n].unit].plan = n;
    rooms_.upload.Add(plan.moves[n].unit);
  }
  rooms_.upload.Predict(&configuration_.view.upload);
  rooms_.upload.Pump();
}

// ---- going on

void ConfigurationProgress::Advance() {
  configuration_.outcomes.ReportArrivals();
  if (configuration_.busy()) configuration_.CountTraffic();
  if (fleet_.now() >= configuration_.due) {
    configuration_.due = kNever;
    if (configuration_.phase() == Phase::kGathering) GatherIfDue();
    if (configuration_.phase() == Phase::kMoving) configuration_.due = rooms_.start.Repeat();
  }
  switch (configuration_.phase()) {
    case Phase::kUploading:
      AdvanceUpload();
      break;
    case Phase::kDisarming:
      if (rooms_.upload.IsOver() && round_.count(Part::kHolding) == 0)
        configuration_.stopping ? configuration_.EndWhenDurable(ConfigurationState::kStopped)
                                : Gather();
      break;
    case Phase::kCommitting:
      AdvanceCommit();
      break;
    case Phase::kHomeCommitting:
      if (IsHeld(rooms_) && (!fleet_.config.in_plane || round_.border.start_at != kNever))
        StartHoming();
      break;
    case Phase::kMoving:
      rooms_.late.Advance();
      if (RoundIsOver()) EndRound();
      break;
    case Phase::kHoming:
      if (round_.count(Part::kMoving) == 0) EndRound();
      break;
    case Phase::kReporting:
      if (!configuration_.outcomes.IsAnyNoted() && rooms_.measurement.IsDurable()) End();
      break;
    case Phase::kMeasuring:
      TakeMeasurement(rooms_.measurement.Advance());
      break;
    case Phase::kIdle:
    case Phase::kGathering:
    case Phase::kPlanning:
      break;
  }
  SayWhatIsWaitedFor(&rooms_);
}

void ConfigurationProgress::AdvanceUpload() {
  rooms_.upload.Pump();
  if (!rooms_.upload.IsOver()) return;
  rooms_.upload.Measure(&configuration_.view.upload);
  if (round_.count(Part::kHolding) != round_.plan.moves.size() || configuration_.stopping)
    return Disarm();
  for (const UnitPlan& move : round_.plan.moves)
    Intend(fleet_, IntentOf(fleet_, round_, configuration_.view.id, move.unit),
           fleet_.units[move.unit].view.offset, move.unit, &round_);
  round_.commit_batch = fleet_.ledger.batch_now();
  configuration_.SetPhase(Phase::kCommitting);
}

/// All units give their moves back.
void ConfigurationProgress::Disarm() {
  configuration_.SetPhase(Phase::kDisarming);
  for (const UnitPlan& move : round_.plan.moves) {
    if (round_.part(move.unit) == Part::kNone) continue;
    const UnitPhase phase = fleet_.units[move.unit].view.phase;
    if (phase == kStaging) {  // nothing was sent yet
      round_.SetPart(move.unit, Part::kNone);
      fleet_.units.SetPhase(move.unit, kReady);
      fleet_.timers.Set(move.unit, fleet_.now() + fleet_.config.poll_period);
    } else if (IsLoaded(phase)) {
      fleet_.requests.Forget(move.unit);
      fleet_.requests.Ask(move.unit, focalfleet::Stop{});
    }
  }
  rooms_.upload.DropWaiting();
}

void ConfigurationProgress::AdvanceCommit() {
  if (fleet_.ledger.committed_through() < round_.commit_batch) return;
  if (IsHeld(rooms_)) {
    const HostInstant start_at = round_.border.start_at;
    if (!fleet_.config.in_plane) return Start(fleet_.now() + fleet_.config.start_delay);
    if (start_at != kNever) return Start(start_at);
    return;
  }
  TakeBackIntents(fleet_, &round_);  // a unit failed while the store wrote
  Disarm();
}

void ConfigurationProgress::Start(HostInstant at) {
  configuration_.view.state = ConfigurationState::kMoving;
  CountPrediction();
  configuration_.Record();
  configuration_.due = rooms_.start.Begin(at);
  configuration_.view.started = round_.started;
  configuration_.SetPhase(Phase::kMoving);
}

void ConfigurationProgress::StartHoming() {
  configuration_.view.state = ConfigurationState::kMoving;
  CountPrediction();
  configuration_.Record();
  rooms_.homing.Start();
  configuration_.view.started = round_.started;
  configuration_.SetPhase(Phase::kHoming);
}

void ConfigurationProgress::CountPrediction() {
  ConfigurationView& view = configuration_.view;
  const PlanPrediction prediction = std::exchange(round_.prediction, {});
  round_.end_s = prediction.makespan_s;
  view.makespan_predicted_s += prediction.makespan_s;
  view.energy_J += prediction.energy_J;
  view.peak_power_W = std::max(view.peak_power_W, prediction.peak_power_W);
}

// ---- the end of a round

bool ConfigurationProgress::RoundIsOver() const {
  return rooms_.late.IsOver() && !round_.HasParts() &&
         std::ranges::none_of(round_.plan.moves, [this](const UnitPlan& move) {
           return rooms_.start.Awaits(move.unit);
         });
}

void ConfigurationProgress::EndRound() {
  ConfigurationView& view = configuration_.view;
  if (round_.started != kNever && round_.last_arrival > round_.started)
    view.makespan_s += (round_.last_arrival - round_.started).seconds();
  view.started = kNever;
  if (configuration_.phase() == Phase::kMoving) rooms_.start.Judge();
  round_.End();
  if (configuration_.stopping) {
    configuration_.EndWhenDurable(ConfigurationState::kStopped);
  } else if (configuration_.phase() == Phase::kHoming) {
    EndHomingWave();
  } else if (!rooms_.homing.HasWave()) {
    JudgeTargets();
  } else if (rooms_.homing.Commit()) {
    configuration_.SetPhase(Phase::kHomeCommitting);
  } else {
    EndRound();
  }
}

void ConfigurationProgress::EndHomingWave() {
  rooms_.homing.EndWave();
  configuration_.view.round = 0;  // each wave has the full number of tries
  // A sector's units may have to make way for others still.
  if (!rooms_.homing.to_home().empty() || fleet_.config.in_plane) return Gather();
  configuration_.EndWhenDurable(ConfigurationState::kDone);
}

void ConfigurationProgress::JudgeTargets() {
  if (rooms_.corrections.EndApproach()) return Gather();
  bool again = false;
  TargetOutcomes& outcomes = configuration_.outcomes;
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) {
    const UnitView& view = fleet_.units[{n}].view;
    const std::optional<Pose>& target = configuration_[{n}].target;
    if (view.outcome != TargetOutcome::kPending) continue;
    if (!IsPlace(view.knowledge) || !target || PlaceOf(view.knowledge) != *target)
      again = true;
    else if (!outcomes.IsNoted({n}))
      // The unit stood there from the start, or waits and will be here until the next exposure.
      outcomes.NoteArrival({n}, rooms_.corrections.Waits({n}) ? round_.settled_batch : 0);
  }
  // A sector asks its plane again, because others may need its units to make way.
  if (fleet_.config.in_plane) again = !round_.border.finished;
  if (again || rooms_.corrections.BeginWave()) return Gather();
  rooms_.corrections.NoteUnitsWithoutRoom();
  MeasureOrEnd();
}

// ---- the measurement and the end

void ConfigurationProgress::MeasureOrEnd() {
  // Some unit must have arrived, durably or not yet, for there to be anything to measure.
  const bool any = configuration_.view.counts.arrived != 0 || configuration_.outcomes.IsAnyNoted();
  if (configuration_.measure && any)
    rooms_.measurement.Start(Look::kAfter);
  else
    configuration_.EndWhenDurable(round_.border.end);
}

void ConfigurationProgress::OnExposure(const ExposureDone& done) {
  // An exposure of a configuration that was stopped is dropped.
  if (configuration_.phase() == Phase::kMeasuring)
    TakeMeasurement(rooms_.measurement.OnExposure(done));
}

void ConfigurationProgress::TakeMeasurement(ConfigurationMeasurement::Progress progress) {
  using Progress = ConfigurationMeasurement::Progress;
  if (progress == Progress::kUnderWay) return;
  const bool taken = progress == Progress::kTaken;
  switch (rooms_.measurement.look()) {
    case Look::kBefore:
      return Gather();
    case Look::kAfter:
      if (!taken || !rooms_.corrections.BeginCorrection())
        return configuration_.EndWhenDurable(round_.border.end);
      sets_out_ = true;
      return Gather();
    case Look::kOnly:
      if (taken)
        JudgeFound(fleet_, &configuration_);
      else
        configuration_.outcomes.SetOfPending(TargetOutcome::kUnmeasured,
                                             "not measured: " + rooms_.measurement.failure());
      return configuration_.EndWhenDurable(taken ? ConfigurationState::kDone
                                                 : ConfigurationState::kFailed);
  }
}

void ConfigurationProgress::End() {
  const bool stopped = configuration_.end == ConfigurationState::kStopped;
  const std::string& failure = configuration_.failure;
  configuration_.outcomes.SetOfPending(stopped ? TargetOutcome::kStopped : TargetOutcome::kFailed,
                                       failure.empty() ? std::string("did not arrive") : failure);
  JudgeMeasured(fleet_, rooms_.corrections, &configuration_);
  round_.Clear();
  rooms_.late.Clear();
  rooms_.homing.Clear();
  rooms_.upload.Clear();
  configuration_.view.state = configuration_.end;
  configuration_.due = kNever;
  configuration_.SetPhase(Phase::kIdle);
  configuration_.Record();
  configuration_.ReplyLast({}, std::string(Name(configuration_.end)));
}

void ConfigurationProgress::Stop(const std::string& reason) {
  configuration_.stopping = true;
  configuration_.failure = reason;
  rooms_.late.EndAll(reason);
  rooms_.start.Cancel();
  for (std::uint32_t n = 0; n < fleet_.units.size(); ++n) {
    // The broadcast may be lost to some: each unit that may move is asked to stop until it answers.
    if (round_.part({n}) == Part::kMoving && IsUnderWay(fleet_.units[{n}].view.phase)) {
      fleet_.requests.Forget({n});
      fleet_.requests.Ask({n}, focalfleet::Stop{});
    }
  }
  switch (configuration_.phase()) {
    case Phase::kGathering:
    case Phase::kPlanning:
    case Phase::kMeasuring:
      configuration_.EndWhenDurable(ConfigurationState::kStopped);
      break;
    case Phase::kUploading:
    case Phase::kCommitting:
      TakeBackIntents(fleet_, &round_);
      Disarm();
      break;
    case Phase::kHomeCommitting:
      TakeBackIntents(fleet_, &round_);
      configuration_.EndWhenDurable(ConfigurationState::kStopped);
      break;
    case Phase::kIdle:
    case Phase::kDisarming:
    case Phase::kMoving:
    case Phase::kHoming:
    case Phase::kReporting:
      break;  // Advance ends it when all have answered
  }
}

}  // namespace focalfleet
