#include "fleet/plane/plane_coordinator.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// After the start instant: whoever has missed the order has given the round back, or will.
constexpr DurationNs kStartOver = Milliseconds(1000);

/// A configuration that this coordinator does not know, or has ended, is stopped.
void OrderToStand(SectorBook* sectors) {
  for (std::uint32_t sector = 0; sector < sectors->size(); ++sector) {
    if (!sectors->IsUsable(sector)) continue;
    const PlaneConfigurationId configuration = (*sectors)[sector].report->configuration;
    sectors->Order(sector,
                   {.kind = configuration.number == 0 ? OrderKind::kStand : OrderKind::kStop,
                    .configuration = configuration});
  }
}

std::shared_ptr<const ApplyCommand> ApplyOf(const PlaneConfiguration& configuration,
                                            std::span<const PositionerIndex> own) {
  auto apply = std::make_shared<ApplyCommand>();
  apply->source = configuration.source;
  apply->fixed = configuration.fixed;
  for (const PositionerIndex i : own) {
    apply->targets.push_back(configuration.targets[i.value]);
    if (!configuration.target_ids.empty())
      apply->target_ids.push_back(configuration.target_ids[i.value]);
  }
  return apply;
}

OutcomeCounts CountOf(const PlaneConfiguration& configuration, const PlaneConfigurationId& id,
                      const SectorBook& sectors) {
  OutcomeCounts sum;
  for (const auto& target : configuration.targets) sum.targeted += target ? 1u : 0u;
  for (std::uint32_t sector = 0; sector < sectors.size(); ++sector) {
    const auto& report = sectors[sector].report;
    if (!report || (report->configuration != id && report->last_over != id)) continue;
    sum.arrived += report->counts.arrived;
    sum.refused += report->counts.refused;
    sum.failed += report->counts.failed;
    sum.stopped += report->counts.stopped;
    sum.unmeasured += report->counts.unmeasured;
  }
  return sum;
}

/// The sector has no part in the round any more.
bool HasLeft(const SectorBook& sectors, std::uint32_t sector, const PlanePart& part,
             const PlaneConfigurationId& id) {
  if (!sectors.IsUsable(sector)) return true;
  const SectorReport& report = *sectors[sector].report;
  return report.incarnation != part.incarnation || report.job != part.job ||
         report.configuration != id;
}

}  // namespace

PlaneCoordinator::PlaneCoordinator(const PlaneLayout* plane, const PlaneTimes& times,
                                   std::uint64_t self, PlaneRecord kept)
    : plane_(*plane),
      times_(times),
      self_(self),
      record_(std::move(kept)),
      sectors_(plane, times),
      clock_watch_(times.clock_patience),
      parts_(plane->sectors()) {
  if (record_.under_way) {
    view_.configuration = record_.under_way->id;
    view_.source = record_.under_way->source;
    view_.state = ConfigurationState::kPlanning;
  }
}

void PlaneCoordinator::Step(const PlaneInputs& inputs, PlaneEffects* effects) {
  out_ = effects;
  now_ = inputs.now;
  kept_ = inputs.kept;
  if (since_.ns == INT64_MIN) since_ = now_;
  for (const SectorReport& report : inputs.reports) sectors_.Hear(report, now_);
  sectors_.Look(now_);
  clock_watch_.Look(sectors_, now_, &out_->notes);
  const PlaneEpoch highest = sectors_.highest_accepted();
  const bool in_charge = view_.phase != PlanePhase::kListening;
  if (in_charge && record_.epoch < highest) {
    out_->log.push_back("another coordinator is in charge, epoch " +
                        std::to_string(highest.number) + ": this one gives no more orders");
    Reply(Error{ErrorCode::kUnavailable, "another coordinator took over"}, {});
    Enter(PlanePhase::kListening);
  }
  for (const PlanePlanDone& plan : inputs.plans) TakePlan(plan);
  for (const PlaneCommand& command : inputs.commands) Obey(command);
  switch (view_.phase) {
    case PlanePhase::kListening:
      Listen();
      break;
    case PlanePhase::kClaiming:
      if (kept_ == record_number_) Claim();
      break;
    case PlanePhase::kIdle:
      OrderToStand(&sectors_);
      break;
    case PlanePhase::kRecording:
      if (kept_ == record_number_) Enter(PlanePhase::kGathering);
      break;
    case PlanePhase::kGathering:
      Gather();
      break;
    case PlanePhase::kPlanning:
      break;
    case PlanePhase::kPreparing:
      Preparing();
      break;
    case PlanePhase::kMoving:
      if (now_ >= view_.start_at + kStartOver) Enter(PlanePhase::kGathering);
      break;
    case PlanePhase::kFinishing:
      Finishing();
      break;
    case PlanePhase::kStopping:
      Stopping();
      break;
  }
  if (record_.under_way) view_.counts = CountOf(*record_.under_way, Id(), sectors_);
  const bool speaks = view_.phase != PlanePhase::kListening && view_.phase != PlanePhase::kClaiming;
  if (speaks) out_->wake_at = std::min(out_->wake_at, sectors_.Say(now_, &out_->orders));
  if (view_.phase != PlanePhase::kIdle)
    out_->wake_at = std::min(out_->wake_at, now_ + times_.repeat);
  out_ = nullptr;
}

void PlaneCoordinator::Enter(PlanePhase phase) {
  view_.phase = phase;
  since_ = now_;
  out_->wake_at = std::min(out_->wake_at, now_);
}

void PlaneCoordinator::Keep() {
  out_->record = record_;
  out_->record_number = ++record_number_;
}

// ---- who is in charge

void PlaneCoordinator::Listen() {
  view_.waiting_for = "the sectors";
  if (now_ < since_ + times_.listen) return;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    const SectorBook::Entry& entry = sectors_[sector];
    if (!sectors_.IsHeard(sector) || entry.report->accepted.number == 0) continue;
    if (entry.report->accepted.coordinator == self_) continue;
    if (entry.report->unordered < times_.takeover) {
      view_.waiting_for = "another coordinator, which is in charge";
      return;
    }
  }
  const PlaneEpoch highest = sectors_.highest_accepted();
  record_.epoch = {std::max(record_.epoch.number, highest.number) + 1, self_};
  Keep();
  Enter(PlanePhase::kClaiming);
}

void PlaneCoordinator::Claim() {
  view_.epoch = record_.epoch;
  view_.waiting_for.clear();
  sectors_.BeginEpoch(record_.epoch);
  round_ = 0;
  out_->log.push_back("in charge of the plane, epoch " + std::to_string(record_.epoch.number));
  Enter(record_.under_way ? PlanePhase::kGathering : PlanePhase::kIdle);
}

// ---- commands

void PlaneCoordinator::Obey(const PlaneCommand& command) {
  if (std::holds_alternative<PlaneStopCommand>(command.what)) {
    if (view_.phase == PlanePhase::kListening || view_.phase == PlanePhase::kClaiming) {
      out_->replies.push_back(
          {command.request,
           true,
           Error{ErrorCode::kRefused, "this coordinator is not in charge: " + view_.waiting_for},
           {}});
      return;
    }
    Stop("stopped by the operator");
    out_->replies.push_back({command.request, true, {}, "done"});
    return;
  }
  const Status status = Apply(command.request, std::get<PlaneApplyCommand>(command.what));
  if (!status) out_->replies.push_back({command.request, true, status.error(), {}});
}

Status PlaneCoordinator::Apply(std::uint64_t request, const PlaneApplyCommand& command) {
  if (view_.phase == PlanePhase::kListening || view_.phase == PlanePhase::kClaiming)
    return Fail(ErrorCode::kRefused, "this coordinator is not in charge: " + view_.waiting_for);
  if (record_.under_way)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(record_.under_way->id) +
                                         " (" + record_.under_way->source +
                                         ") is under way: stop it or wait until it ends");
  if (view_.phase != PlanePhase::kIdle)
    return Fail(ErrorCode::kRefused, "the plane is still stopping: try again in a moment");
  const std::size_t units = plane_.layout().size();
  if (command.targets.size() != units ||
      (!command.target_ids.empty() && command.target_ids.size() != units))
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  record_.under_way = PlaneConfiguration{.id = record_.next_configuration++,
                                         .source = command.source,
                                         .fixed = command.fixed,
                                         .targets = command.targets,
                                         .target_ids = command.target_ids};
  view_ = {.phase = view_.phase,
           .epoch = view_.epoch,
           .configuration = record_.under_way->id,
           .source = command.source,
           .state = ConfigurationState::kPlanning};
  request_ = request;
  out_->replies.push_back(
      {request, false, {}, "configuration " + std::to_string(record_.under_way->id)});
  Keep();
  Enter(PlanePhase::kRecording);
  return {};
}

void PlaneCoordinator::Reply(std::optional<Error> error, std::string text) {
  if (request_ == 0) return;
  out_->replies.push_back({std::exchange(request_, 0), true, std::move(error), std::move(text)});
}

// ---- gathering

/// Orders what brings the sector to ask for a plan, and says how far it is.
PlaneCoordinator::Readiness PlaneCoordinator::Prepare(std::uint32_t sector) {
  const SectorBook::Entry& entry = sectors_[sector];
  if (sectors_.IsHeard(sector) && entry.report->stage == SectorStage::kMoving)
    return Readiness::kMoves;
  if (!sectors_.IsUsable(sector)) return Readiness::kAbsent;
  const SectorReport& report = *entry.report;
  const PlaneConfigurationId id = Id();
  if (report.configuration == id) {
    if (report.round != 0 &&
        (report.stage == SectorStage::kReady || report.stage == SectorStage::kPreparing))
      sectors_.Order(sector,
                     {.kind = OrderKind::kWithdraw, .configuration = id, .job = report.job});
    const bool asks = report.stage == SectorStage::kAsking && entry.job != nullptr &&
                      entry.job->job == report.job;
    return asks ? Readiness::kReady : Readiness::kWaits;
  }
  if (report.configuration.number != 0) {
    sectors_.Order(sector, {.kind = OrderKind::kStop, .configuration = report.configuration});
    return Readiness::kWaits;
  }
  if (report.last_over == id) return Readiness::kOver;
  if (report.stage == SectorStage::kIdle)
    sectors_.Order(sector, {.kind = OrderKind::kConfigure,
                            .configuration = id,
                            .apply = ApplyOf(*record_.under_way, plane_.own(sector))});
  return Readiness::kWaits;
}

void PlaneCoordinator::Gather() {
  std::vector<std::uint32_t> ready;
  std::string awaited;
  bool moves = false;
  bool settling = false;  // some sector takes part and is not ready yet
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    switch (Prepare(sector)) {
      case Readiness::kReady:
        ready.push_back(sector);
        break;
      case Readiness::kMoves:
        moves = true;
        break;
      case Readiness::kOver:
        // A sector that was stopped where it is: nothing moves until an operator applies again.
        if (sectors_[sector].report->last_state == ConfigurationState::kStopped)
          return Stop(NameOfSector(sector) + " was stopped");
        break;
      case Readiness::kWaits:
      case Readiness::kAbsent:
        if (awaited.empty()) awaited = NameOfSector(sector);
        if (sectors_.IsUsable(sector)) settling = true;
        break;
    }
  }
  if (moves) {
    view_.state = ConfigurationState::kMoving;
    view_.waiting_for.clear();
    since_ = now_;
    return;
  }
  view_.state = ConfigurationState::kPlanning;
  view_.waiting_for = awaited;
  if (!awaited.empty() && now_ < since_ + times_.gather_patience) return;
  if (!ready.empty()) return Plan(ready, settling);
  if (awaited.empty()) End(ConfigurationState::kDone);  // all sectors have ended it
}

void PlaneCoordinator::Plan(const std::vector<std::uint32_t>& ready, bool settling) {
  std::vector<std::shared_ptr<const SectorJob>> jobs(sectors_.size());
  for (PlanePart& part : parts_) part = {};
  for (const std::uint32_t sector : ready) {
    jobs[sector] = sectors_[sector].job;
    parts_[sector] = {sectors_[sector].report->incarnation, jobs[sector]->job};
  }
  PlaneJob job = MakePlaneJob(++job_, plane_, jobs, times_.border_notice.seconds(),
                              times_.clock_allowance.seconds());
  strip_.assign(plane_.layout().size(), 0);
  for (std::size_t n = 0; n < job.units.size(); ++n) strip_[job.units[n].value] = job.strip[n];
  if (!HasWork(job)) {
    // A sector that still reads its units, as after a kill in motion, is waited for.
    if (settling && now_ < since_ + times_.settle_patience) return;
    return Finish({}, nullptr);
  }
  if (view_.rounds == limits::kRoundsPerPlane)
    return Finish("gave up after " + std::to_string(view_.rounds) + " rounds", nullptr);
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    if (jobs[sector] == nullptr)
      out_->log.push_back(NameOfSector(sector) + " is left out of this round: it " +
                          (sectors_.IsUsable(sector) ? "is not ready" : sectors_[sector].trouble));
  view_.waiting_for.clear();
  ++view_.rounds;
  out_->job = std::move(job);
  Enter(PlanePhase::kPlanning);
}

// ---- the round

void PlaneCoordinator::TakePlan(const PlanePlanDone& done) {
  if (view_.phase != PlanePhase::kPlanning || done.job != job_) return;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    if (parts_[sector].job != 0 && HasLeft(sectors_, sector, parts_[sector], Id()))
      return Enter(PlanePhase::kGathering);
  if (!done.plan) return Finish(done.plan.error().text, nullptr);
  if (done.plan->moves == 0) return Finish({}, &*done.plan);
  GiveRound(*done.plan);
}

void PlaneCoordinator::GiveRound(PlanePlan plan) {
  ++round_;
  view_.makespan_predicted_s += plan.makespan_s;
  view_.follows_beyond = plan.follows_beyond;
  view_.unnoticed = plan.unnoticed;
  view_.state = ConfigurationState::kUploading;
  const auto moves = [&](std::uint32_t sector) { return !plan.rounds[sector].moves.empty(); };
  std::vector<std::vector<std::uint32_t>> together(sectors_.size());
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    for (const std::uint32_t other : plane_.neighbours(sector))
      if (moves(other)) together[sector].push_back(other);
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (!moves(sector)) {
      parts_[sector] = {};  // its units stand
      continue;
    }
    sectors_.Order(
        sector,
        {.kind = OrderKind::kRound,
         .configuration = Id(),
         .round = round_,
         .job = parts_[sector].job,
         .together = together[sector],
         .round_body = std::make_shared<const SectorRound>(std::move(plan.rounds[sector]))});
  }
  Enter(PlanePhase::kPreparing);
}

void PlaneCoordinator::Preparing() {
  std::string awaited;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (parts_[sector].job == 0) continue;
    // A new plan goes around whoever has left; the others give this round back.
    if (HasLeft(sectors_, sector, parts_[sector], Id())) return Enter(PlanePhase::kGathering);
    const SectorReport& report = *sectors_[sector].report;
    const bool holds = report.stage == SectorStage::kReady && report.round == round_;
    if (!holds && awaited.empty()) awaited = NameOfSector(sector);
  }
  view_.waiting_for = awaited;
  if (awaited.empty()) return Start();
  if (now_ >= since_ + times_.round_patience) Enter(PlanePhase::kGathering);
}

void PlaneCoordinator::Start() {
  double start_delay_s = 0;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    if (parts_[sector].job != 0)
      start_delay_s = std::max(start_delay_s, sectors_[sector].report->start_delay_s);
  view_.start_at = now_ + Seconds(start_delay_s) + times_.confirm_window;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    if (parts_[sector].job != 0)
      sectors_.Order(sector, {.kind = OrderKind::kStart,
                              .configuration = Id(),
                              .round = round_,
                              .job = parts_[sector].job,
                              .start_at = view_.start_at});
  view_.state = ConfigurationState::kMoving;
  Enter(PlanePhase::kMoving);
}

// ---- the end

/// Nothing more is to move: every sector that asks ends the configuration.
void PlaneCoordinator::Finish(const std::string& failure, const PlanePlan* plan) {
  end_ = failure.empty() ? ConfigurationState::kDone : ConfigurationState::kFailed;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (parts_[sector].job == 0) continue;
    auto body = std::make_shared<SectorRound>();
    body->job = parts_[sector].job;
    body->finished = true;
    body->failure = failure;
    if (plan != nullptr) body->refused = plan->rounds[sector].refused;
    const auto own = plane_.own(sector);
    for (std::uint32_t n = 0; n < own.size(); ++n)
      if (strip_[own[n].value] != 0)
        body->refused.push_back({PositionerIndex{n}, "a sector in its reach takes no part"});
    sectors_.Order(sector, {.kind = OrderKind::kRound,
                            .configuration = Id(),
                            .round = round_ + 1,
                            .job = parts_[sector].job,
                            .round_body = std::move(body)});
  }
  ++round_;
  Enter(PlanePhase::kFinishing);
}

void PlaneCoordinator::Finishing() {
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (parts_[sector].job == 0 || !sectors_.IsUsable(sector)) continue;
    const SectorReport& report = *sectors_[sector].report;
    if (report.incarnation != parts_[sector].incarnation) continue;
    if (report.configuration != Id()) continue;  // it has ended
    // A unit failed meanwhile, and the sector asks anew.
    if (report.stage == SectorStage::kAsking && report.job != parts_[sector].job)
      return Enter(PlanePhase::kGathering);
    if (now_ < since_ + times_.finish_patience) return;
  }
  End(end_);
}

void PlaneCoordinator::Stop(const std::string& why) {
  out_->log.push_back("stop: " + why);
  end_ = ConfigurationState::kStopped;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    // The number makes this order another one than an earlier stop.
    sectors_.Order(sector, {.kind = OrderKind::kStop, .configuration = Id(), .round = ++round_});
  Enter(PlanePhase::kStopping);
}

void PlaneCoordinator::Stopping() {
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (!sectors_.IsHeard(sector)) continue;
    const SectorReport& report = *sectors_[sector].report;
    if (report.configuration.number == 0 && sectors_.IsDone(sector)) continue;
    if (report.incarnation != sectors_[sector].order.incarnation)
      sectors_.Order(sector, {.kind = OrderKind::kStop, .configuration = Id(), .round = ++round_});
    if (now_ < since_ + times_.round_patience) return;
  }
  End(ConfigurationState::kStopped);
}

void PlaneCoordinator::End(ConfigurationState state) {
  if (record_.under_way) view_.counts = CountOf(*record_.under_way, Id(), sectors_);
  view_.waiting_for.clear();
  if (record_.under_way) {
    view_.state = state;
    out_->log.push_back("configuration " + std::to_string(record_.under_way->id) +
                        " is over: " + Name(state));
    record_.under_way.reset();
    Keep();
  }
  Reply({}, Name(state));
  Enter(PlanePhase::kIdle);
}

}  // namespace focalfleet
