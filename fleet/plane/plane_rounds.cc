// The rounds of the plane's coordinator, from gathering to the end of a configuration.
#include <algorithm>
#include <utility>

#include "fleet/plane/plane_coordinator.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// After the start instant: whoever has missed the order has given the round back, or will.
constexpr DurationNs kStartOver = Milliseconds(1000);

bool IsAtTarget(const SectorJob& job, std::uint32_t local) {
  const std::optional<Pose>& target = job.targets[local];
  return target && IsPlace(job.start[local]) && PlaceOf(job.start[local]) == *target;
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

/// The part of a sector in the configuration.
std::shared_ptr<const SectorTask> PlaneCoordinator::TaskOf(const PlaneConfiguration& configuration,
                                                           std::uint32_t sector) const {
  auto task = std::make_shared<SectorTask>();
  if (configuration.kind == ConfigurationKind::kHome) {
    HomeCommand home{.units = {}, .unproven = configuration.unproven};
    for (const PositionerIndex i : configuration.to_home)
      if (plane_.SectorOf(i) == sector) home.units.push_back(plane_.Local(i));
    task->what = std::move(home);
    return task;
  }
  if (configuration.kind == ConfigurationKind::kMeasure) {
    task->what = MeasureCommand{};
    return task;
  }
  ApplyCommand apply{.source = configuration.source, .targets = {}, .fixed = configuration.fixed};
  apply.measure = configuration.measure;
  for (const PositionerIndex i : plane_.own(sector)) {
    apply.targets.push_back(configuration.targets[i.value]);
    if (!configuration.target_ids.empty())
      apply.target_ids.push_back(configuration.target_ids[i.value]);
  }
  task->what = std::move(apply);
  return task;
}

// ---- gathering

/// The part in a plan of a sector whose units stand where they are; null: that is not sure.
std::shared_ptr<const SectorJob> PlaneCoordinator::StandingJob(std::uint32_t sector) const {
  if (!sectors_.IsUsable(sector)) return nullptr;
  const SectorBook::Entry& entry = sectors_[sector];
  const SectorReport& report = *entry.report;
  auto job = std::make_shared<SectorJob>();
  if (report.configuration == Id() && Looks(sector)) {
    job->start = entry.exposure->expected;
    job->drives = entry.exposure->drives;
  } else if (report.configuration.number == 0 && report.last_over == Id() &&
             report.stage == SectorStage::kIdle && entry.places != nullptr &&
             report.places_now != 0 && report.places_now == entry.places_digest) {
    job->start = entry.places->places;
    job->drives = entry.places->drives;
  } else {
    return nullptr;
  }
  job->targets.resize(entry.units);
  job->frozen.assign(entry.units, 1);
  job->offsets.resize(entry.units);
  return job;
}

/// Orders what brings the sector to ask for a plan, and says how far it is.
PlaneCoordinator::Readiness PlaneCoordinator::Prepare(std::uint32_t sector) {
  const SectorBook::Entry& entry = sectors_[sector];
  const PlaneConfigurationId id = Id();
  const bool usable = sectors_.IsUsable(sector);
  if (sectors_.IsHeard(sector) && entry.report->stage == SectorStage::kMoving) {
    // Its other targets are known to it before its next plan.
    if (usable && entry.report->configuration == id &&
        entry.report->change < LastChangeOf(sector) && kept_ == record_number_)
      sectors_.Order(sector, RetargetsOf(sector));
    return Readiness::kMoves;
  }
  if (!usable) return Readiness::kAbsent;
  const SectorReport& report = *entry.report;
  if (report.configuration == id) return PrepareOwn(sector);
  if (report.configuration.number != 0) {
    sectors_.Order(sector, {.kind = OrderKind::kStop, .configuration = report.configuration});
    return Readiness::kWaits;
  }
  if (report.last_over == id) return Readiness::kOver;
  // A change of targets is durable before a sector hears of it.
  if (report.stage == SectorStage::kIdle && kept_ == record_number_)
    sectors_.Order(sector, {.kind = OrderKind::kConfigure,
                            .configuration = id,
                            .change = LastChangeOf(sector),
                            .task = TaskOf(*record_.under_way, sector)});
  return Readiness::kWaits;
}

/// The sector has the configuration under way.
PlaneCoordinator::Readiness PlaneCoordinator::PrepareOwn(std::uint32_t sector) {
  const SectorBook::Entry& entry = sectors_[sector];
  const SectorReport& report = *entry.report;
  if (report.change < LastChangeOf(sector)) {
    if (kept_ == record_number_) sectors_.Order(sector, RetargetsOf(sector));
    return Readiness::kWaits;
  }
  if (report.stage == SectorStage::kLooking)
    return Looks(sector) ? Readiness::kLooks : Readiness::kWaits;
  if (report.round != 0 &&
      (report.stage == SectorStage::kReady || report.stage == SectorStage::kPreparing))
    sectors_.Order(sector,
                   {.kind = OrderKind::kWithdraw, .configuration = Id(), .job = report.job});
  const bool asks =
      report.stage == SectorStage::kAsking && entry.job != nullptr && entry.job->job == report.job;
  return asks ? Readiness::kReady : Readiness::kWaits;
}

void PlaneCoordinator::Gather() {
  std::vector<std::uint32_t> ready;
  std::string awaited;
  bool moves = false;
  bool looks = false;
  bool looks_first = false;  // units of unknown place are to be found before any unit moves
  bool settling = false;     // some sector takes part and is not ready yet
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    switch (Prepare(sector)) {
      case Readiness::kReady:
        ready.push_back(sector);
        break;
      case Readiness::kMoves:
        moves = true;
        break;
      case Readiness::kLooks:
        looks = true;
        looks_first |= sectors_[sector].exposure->first;
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
  if (looks && (looks_first || ready.empty())) return Look();
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
  // Sectors that have ended the configuration, or wait for an exposure, stand, and others may move
  // beside them: no order but this coordinator's can move their units while they follow it.
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector)
    if (jobs[sector] == nullptr) jobs[sector] = StandingJob(sector);
  PlaneJob job = MakePlaneJob(++job_, plane_, jobs, times_.border_notice.seconds(),
                              times_.clock_allowance.seconds());
  strip_.assign(plane_.layout().size(), 0);
  for (std::size_t n = 0; n < job.units.size(); ++n) strip_[job.units[n].value] = job.strip[n];
  if (!HasWork(job)) {
    // A sector that still reads its units, as after a kill in motion, is waited for.
    if (settling && now_ < since_ + times_.settle_patience) return;
    return Finish({}, nullptr);
  }
  if (job.plan.to_home.size() < std::exchange(to_home_, job.plan.to_home.size())) tries_ = 0;
  if (tries_++ == limits::kRoundsPerPlane)
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
  if (done.plan->moves == 0 && done.plan->homing == 0) return Finish({}, &*done.plan);
  GiveRound(*done.plan);
}

void PlaneCoordinator::GiveRound(PlanePlan plan) {
  ++round_;
  view_.makespan_predicted_s += plan.makespan_s;
  view_.follows_beyond = plan.follows_beyond;
  view_.unnoticed = plan.unnoticed;
  view_.state = ConfigurationState::kUploading;
  const auto moves = [&](std::uint32_t sector) {
    return !plan.rounds[sector].moves.empty() || !plan.rounds[sector].homing.empty();
  };
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

void PlaneCoordinator::Moving() {
  if (now_ >= view_.start_at + kStartOver) Enter(PlanePhase::kGathering);
}

// ---- the end

/// The order by which a sector that asks ends the configuration.
PlaneOrder PlaneCoordinator::EndOf(std::uint32_t sector, SectorRound body) const {
  body.job = parts_[sector].job;
  body.finished = true;
  return {.kind = OrderKind::kRound,
          .configuration = Id(),
          .round = round_,
          .job = body.job,
          .round_body = std::make_shared<const SectorRound>(std::move(body))};
}

/// Nothing more is to move: every sector that asks ends the configuration.
void PlaneCoordinator::Finish(const std::string& failure, const PlanePlan* plan) {
  end_ = failure.empty() ? ConfigurationState::kDone : ConfigurationState::kFailed;
  ++round_;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (parts_[sector].job == 0) continue;
    SectorRound body;
    body.failure = failure;
    if (plan != nullptr) body.refused = plan->rounds[sector].refused;
    const auto own = plane_.own(sector);
    const SectorJob& job = *sectors_[sector].job;
    for (std::uint32_t n = 0; n < own.size(); ++n)
      if (strip_[own[n].value] != 0 && !IsAtTarget(job, n))
        body.refused.push_back({PositionerIndex{n}, "a sector in its reach takes no part"});
    sectors_.Order(sector, EndOf(sector, std::move(body)));
  }
  Enter(PlanePhase::kFinishing);
}

void PlaneCoordinator::Finishing() {
  bool looks = false;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (sectors_.IsUsable(sector)) looks |= Looks(sector);
    if (parts_[sector].job == 0 || !sectors_.IsUsable(sector)) continue;
    const SectorReport& report = *sectors_[sector].report;
    if (report.incarnation != parts_[sector].incarnation) continue;
    if (report.configuration != Id() || Looks(sector)) continue;  // its part is over
    // A unit failed meanwhile, and the sector asks anew.
    if (report.stage == SectorStage::kAsking && report.job != parts_[sector].job)
      return Enter(PlanePhase::kGathering);
    // Before an exposure arrivals become durable, and sensors are read.
    const bool measures = record_.under_way->measure.has_value();
    if (now_ < since_ + (measures ? times_.round_patience : times_.finish_patience)) return;
  }
  if (looks) return Enter(PlanePhase::kGathering);
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
  view_.waiting_for.clear();
  if (record_.under_way) {
    Count();
    view_.state = state;
    out_->log.push_back("configuration " + std::to_string(record_.under_way->id) +
                        " is over: " + Name(state));
    record_.last = std::exchange(record_.under_way, {});
    record_.last_state = state;
    Keep();
  }
  for (PlanePart& part : parts_) part = {};
  Reply({}, Name(state));
  Enter(PlanePhase::kIdle);
}

// ---- after the end

/// A sector that has begun another life is told of the last configuration: where its units were to
/// go. Nothing moves. The sector then knows, and reports, which of them stand there.
void PlaneCoordinator::Recall(std::uint32_t sector) {
  const SectorBook::Entry& entry = sectors_[sector];
  const SectorReport& report = *entry.report;
  if (report.configuration != Id()) {
    if (report.stage == SectorStage::kIdle)
      sectors_.Order(sector, {.kind = OrderKind::kConfigure,
                              .configuration = Id(),
                              .task = TaskOf(*record_.last, sector)});
    return;
  }
  const bool asks =
      report.stage == SectorStage::kAsking && entry.job != nullptr && entry.job->job == report.job;
  const PlanePart part{report.incarnation, report.job};
  if (!asks || parts_[sector] == part) return;
  parts_[sector] = part;
  ++round_;
  SectorRound body;
  for (std::uint32_t n = 0; n < entry.units; ++n)
    if (entry.job->targets[n] && !IsAtTarget(*entry.job, n))
      body.refused.push_back(
          {PositionerIndex{n},
           std::string("it does not stand there, and the configuration is over: ") +
               Name(record_.last_state)});
  sectors_.Order(sector, EndOf(sector, std::move(body)));
}

}  // namespace focalfleet
