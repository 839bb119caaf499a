#include "fleet/plane/plane_rounds.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

// After the start instant: whoever has missed the order has given the round back, or will.
constexpr DurationNs kStartOver = Milliseconds(1000);

/// The sector has no part in the round any more.
bool HasLeft(const SectorBook& sectors, std::uint32_t sector, const PlanePart& part,
             const PlaneConfigurationId& id) {
  if (!sectors.IsUsable(sector)) return true;
  const SectorReport& report = *sectors[sector].report;
  return report.incarnation != part.incarnation || report.job != part.job ||
         report.configuration != id;
}

}  // namespace

bool IsAtTarget(const SectorJob& job, std::uint32_t local) {
  const std::optional<Pose>& target = job.targets[local];
  return target && IsPlace(job.start[local]) && PlaceOf(job.start[local]) == *target;
}

PlaneOrder EndOf(std::uint64_t job, const PlaneConfigurationId& id, std::uint64_t round,
                 SectorRound body) {
  body.job = job;
  body.finished = true;
  return {.kind = OrderKind::kRound,
          .configuration = id,
          .round = round,
          .job = job,
          .round_body = std::make_shared<const SectorRound>(std::move(body))};
}

void Withdraw(std::uint32_t sector, SectorBook* sectors) {
  const SectorReport& report = *(*sectors)[sector].report;
  if (report.round != 0 &&
      (report.stage == SectorStage::kReady || report.stage == SectorStage::kPreparing))
    sectors->Order(
        sector,
        {.kind = OrderKind::kWithdraw, .configuration = report.configuration, .job = report.job});
}

void PlaneRounds::Begin() {
  tries_ = 0;
  to_home_ = 0;
  end_ = ConfigurationState::kDone;
}

// ---- gathering

/// Orders what brings the sector to ask for a plan, and says how far it is.
PlaneRounds::Readiness PlaneRounds::Prepare(std::uint32_t sector) {
  const SectorBook::Entry& entry = state_.sectors[sector];
  const PlaneConfigurationId id = state_.Id();
  const bool usable = state_.sectors.IsUsable(sector);
  if (state_.sectors.IsHeard(sector) && entry.report->stage == SectorStage::kMoving) {
    // Its other targets are known to it before its next plan.
    if (usable && entry.report->configuration == id &&
        entry.report->change < LastChangeOf(*state_.record.under_way, state_.plane, sector) &&
        state_.IsKept())
      state_.sectors.Order(
          sector, RetargetsOf(*state_.record.under_way, state_.plane, state_.Id(), sector));
    return Readiness::kMoves;
  }
  if (!usable) return Readiness::kAbsent;
  const SectorReport& report = *entry.report;
  if (report.configuration == id) return PrepareOwn(sector);
  if (report.configuration.number != 0) {
    state_.sectors.Order(sector, {.kind = OrderKind::kStop, .configuration = report.configuration});
    return Readiness::kWaits;
  }
  if (report.last_over == id) return Readiness::kOver;
  // A change of targets is durable before a sector hears of it.
  if (report.stage == SectorStage::kIdle && state_.IsKept())
    state_.sectors.Order(sector,
                         {.kind = OrderKind::kConfigure,
                          .configuration = id,
                          .change = LastChangeOf(*state_.record.under_way, state_.plane, sector),
                          .task = PartOf(*state_.record.under_way, state_.plane, sector)});
  return Readiness::kWaits;
}

/// The sector has the configuration under way.
PlaneRounds::Readiness PlaneRounds::PrepareOwn(std::uint32_t sector) {
  const SectorBook::Entry& entry = state_.sectors[sector];
  const SectorReport& report = *entry.report;
  if (report.change < LastChangeOf(*state_.record.under_way, state_.plane, sector)) {
    if (state_.IsKept())
      state_.sectors.Order(
          sector, RetargetsOf(*state_.record.under_way, state_.plane, state_.Id(), sector));
    return Readiness::kWaits;
  }
  if (report.stage == SectorStage::kLooking)
    return Looks(state_.sectors, sector, state_.Id()) ? Readiness::kLooks : Readiness::kWaits;
  Withdraw(sector, &state_.sectors);
  const bool asks =
      report.stage == SectorStage::kAsking && entry.job != nullptr && entry.job->job == report.job;
  return asks ? Readiness::kReady : Readiness::kWaits;
}

void PlaneRounds::Gather() {
  std::vector<std::uint32_t> ready;
  std::string awaited;
  bool moves = false;
  bool looks = false;
  bool looks_first = false;  // units of unknown place are to be found before any unit moves
  bool settling = false;     // some sector takes part and is not ready yet
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    switch (Prepare(sector)) {
      case Readiness::kReady:
        ready.push_back(sector);
        break;
      case Readiness::kMoves:
        moves = true;
        break;
      case Readiness::kLooks:
        looks = true;
        looks_first |= state_.sectors[sector].exposure->first;
        break;
      case Readiness::kOver:
        // A sector that was stopped where it is: nothing moves until an operator applies again.
        if (state_.sectors[sector].report->last_state == ConfigurationState::kStopped)
          return Stop(NameOfSector(sector) + " was stopped");
        break;
      case Readiness::kWaits:
      case Readiness::kAbsent:
        if (awaited.empty()) awaited = NameOfSector(sector);
        if (state_.sectors.IsUsable(sector)) settling = true;
        break;
    }
  }
  if (moves) {
    state_.view.state = ConfigurationState::kMoving;
    state_.view.waiting_for.clear();
    state_.since = state_.now;
    return;
  }
  state_.view.state = ConfigurationState::kPlanning;
  state_.view.waiting_for = awaited;
  if (!awaited.empty() && state_.now < state_.since + state_.times.gather_patience) return;
  if (looks && (looks_first || ready.empty())) return Look();
  if (!ready.empty()) return Plan(ready, settling);
  if (awaited.empty()) End(end_);  // all sectors have ended it
}

void PlaneRounds::Plan(const std::vector<std::uint32_t>& ready, bool settling) {
  std::vector<std::shared_ptr<const SectorJob>> jobs(state_.sectors.size());
  for (PlanePart& part : parts_) part = {};
  for (const std::uint32_t sector : ready) {
    jobs[sector] = state_.sectors[sector].job;
    parts_[sector] = {state_.sectors[sector].report->incarnation, jobs[sector]->job};
  }
  // Sectors that have ended the configuration, or wait for an exposure, stand, and others may move
  // beside them: no order but this coordinator's can move their units while they follow it.
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (jobs[sector] == nullptr) jobs[sector] = StandingJob(state_.sectors, sector, state_.Id());
  PlaneJob job = MakePlaneJob(++job_, state_.plane, jobs, state_.times.border_notice.seconds(),
                              state_.times.clock_allowance.seconds());
  strip_.assign(state_.plane.layout().size(), 0);
  for (std::size_t n = 0; n < job.units.size(); ++n) strip_[job.units[n].value] = job.strip[n];
  if (!HasWork(job)) {
    // A sector that still reads its units, as after a kill in motion, is waited for.
    if (settling && state_.now < state_.since + state_.times.settle_patience) return;
    return Finish({}, nullptr);
  }
  if (job.plan.to_home.size() < std::exchange(to_home_, job.plan.to_home.size())) tries_ = 0;
  if (tries_++ == limits::kRoundsPerPlane)
    return Finish("gave up after " + std::to_string(state_.view.rounds) + " rounds", nullptr);
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (jobs[sector] == nullptr)
      state_.out->log.push_back(
          NameOfSector(sector) + " is left out of this round: it " +
          (state_.sectors.IsUsable(sector) ? "is not ready" : state_.sectors[sector].trouble));
  state_.view.waiting_for.clear();
  ++state_.view.rounds;
  state_.out->job = std::move(job);
  state_.Enter(PlanePhase::kPlanning);
}

// ---- the round

void PlaneRounds::TakePlan(const PlanePlanDone& done) {
  if (state_.view.phase != PlanePhase::kPlanning || done.job != job_) return;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (parts_[sector].job != 0 && HasLeft(state_.sectors, sector, parts_[sector], state_.Id()))
      return state_.Enter(PlanePhase::kGathering);
  if (!done.plan) return Finish(done.plan.error().text, nullptr);
  if (done.plan->moves == 0 && done.plan->homing == 0) return Finish({}, &*done.plan);
  GiveRound(*done.plan);
}

void PlaneRounds::GiveRound(PlanePlan plan) {
  ++state_.round;
  state_.view.makespan_predicted_s += plan.makespan_s;
  state_.view.follows_beyond = plan.follows_beyond;
  state_.view.unnoticed = plan.unnoticed;
  state_.view.state = ConfigurationState::kUploading;
  const auto moves = [&](std::uint32_t sector) {
    return !plan.rounds[sector].moves.empty() || !plan.rounds[sector].homing.empty();
  };
  std::vector<std::vector<std::uint32_t>> together(state_.sectors.size());
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    for (const std::uint32_t other : state_.plane.neighbours(sector))
      if (moves(other)) together[sector].push_back(other);
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (!moves(sector)) {
      parts_[sector] = {};  // its units stand
      continue;
    }
    state_.sectors.Order(
        sector,
        {.kind = OrderKind::kRound,
         .configuration = state_.Id(),
         .round = state_.round,
         .job = parts_[sector].job,
         .together = together[sector],
         .round_body = std::make_shared<const SectorRound>(std::move(plan.rounds[sector]))});
  }
  state_.Enter(PlanePhase::kPreparing);
}

void PlaneRounds::Preparing() {
  std::string awaited;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (parts_[sector].job == 0) continue;
    // A new plan goes around whoever has left; the others give this round back.
    if (HasLeft(state_.sectors, sector, parts_[sector], state_.Id()))
      return state_.Enter(PlanePhase::kGathering);
    const SectorReport& report = *state_.sectors[sector].report;
    const bool holds = report.stage == SectorStage::kReady && report.round == state_.round;
    if (!holds && awaited.empty()) awaited = NameOfSector(sector);
  }
  state_.view.waiting_for = awaited;
  if (awaited.empty()) return Start();
  if (state_.now >= state_.since + state_.times.round_patience)
    state_.Enter(PlanePhase::kGathering);
}

void PlaneRounds::Start() {
  double start_delay_s = 0;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (parts_[sector].job != 0)
      start_delay_s = std::max(start_delay_s, state_.sectors[sector].report->start_delay_s);
  state_.view.start_at = state_.now + Seconds(start_delay_s) + state_.times.confirm_window;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (parts_[sector].job != 0)
      state_.sectors.Order(sector, {.kind = OrderKind::kStart,
                                    .configuration = state_.Id(),
                                    .round = state_.round,
                                    .job = parts_[sector].job,
                                    .start_at = state_.view.start_at});
  state_.view.state = ConfigurationState::kMoving;
  state_.Enter(PlanePhase::kMoving);
}

void PlaneRounds::Moving() {
  if (state_.now >= state_.view.start_at + kStartOver) state_.Enter(PlanePhase::kGathering);
}

// ---- the end

/// Nothing more is to move: every sector that asks ends the configuration.
void PlaneRounds::Finish(const std::string& failure, const PlanePlan* plan) {
  end_ = failure.empty() ? ConfigurationState::kDone : ConfigurationState::kFailed;
  ++state_.round;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (parts_[sector].job == 0) continue;
    SectorRound body;
    body.end = end_;
    body.failure = failure;
    if (plan != nullptr) body.refused = plan->rounds[sector].refused;
    const auto own = state_.plane.own(sector);
    const SectorJob& job = *state_.sectors[sector].job;
    for (std::uint32_t n = 0; n < own.size(); ++n)
      if (strip_[own[n].value] != 0 && !IsAtTarget(job, n))
        body.refused.push_back({PositionerIndex{n}, "a sector in its reach takes no part"});
    state_.sectors.Order(sector,
                         EndOf(parts_[sector].job, state_.Id(), state_.round, std::move(body)));
  }
  state_.Enter(PlanePhase::kFinishing);
}

void PlaneRounds::Finishing() {
  bool looks = false;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    looks |= Looks(state_.sectors, sector, state_.Id());
    if (parts_[sector].job == 0 || !state_.sectors.IsUsable(sector)) continue;
    const SectorReport& report = *state_.sectors[sector].report;
    if (report.incarnation != parts_[sector].incarnation) continue;
    if (report.configuration != state_.Id() || Looks(state_.sectors, sector, state_.Id()))
      continue;  // its part is over
    // A unit failed meanwhile, and the sector asks anew.
    if (report.stage == SectorStage::kAsking && report.job != parts_[sector].job)
      return state_.Enter(PlanePhase::kGathering);
    // Before an exposure arrivals become durable, and sensors are read.
    const bool measures = state_.record.under_way->measure.has_value();
    if (state_.now <
        state_.since + (measures ? state_.times.round_patience : state_.times.finish_patience))
      return;
  }
  if (looks) return state_.Enter(PlanePhase::kGathering);
  End(end_);
}

void PlaneRounds::Stop(const std::string& why) {
  state_.out->log.push_back("stop: " + why);
  end_ = ConfigurationState::kStopped;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    // The number makes this order another one than an earlier stop.
    state_.sectors.Order(
        sector, {.kind = OrderKind::kStop, .configuration = state_.Id(), .round = ++state_.round});
  state_.Enter(PlanePhase::kStopping);
}

void PlaneRounds::Stopping() {
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (!state_.sectors.IsHeard(sector)) continue;
    const SectorReport& report = *state_.sectors[sector].report;
    if (report.configuration.number == 0 && state_.sectors.IsDone(sector)) continue;
    if (report.incarnation != state_.sectors[sector].order.incarnation)
      state_.sectors.Order(
          sector,
          {.kind = OrderKind::kStop, .configuration = state_.Id(), .round = ++state_.round});
    if (state_.now < state_.since + state_.times.round_patience) return;
  }
  End(ConfigurationState::kStopped);
}

void PlaneRounds::End(ConfigurationState state) {
  state_.view.waiting_for.clear();
  if (state_.record.under_way) {
    state_.view.state = state;
    state_.out->log.push_back("configuration " + std::to_string(state_.record.under_way->id) +
                              " is over: " + Name(state));
    state_.record.last = std::exchange(state_.record.under_way, {});
    state_.record.last_state = state;
    state_.Keep();
  }
  for (PlanePart& part : parts_) part = {};
  state_.Reply({}, Name(state));
  state_.Enter(PlanePhase::kIdle);
}

// ---- exposures

void PlaneRounds::Look() {
  for (PlanePart& part : parts_) part = {};
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector)
    if (Looks(state_.sectors, sector, state_.Id()))
      parts_[sector] = {state_.sectors[sector].report->incarnation,
                        state_.sectors[sector].exposure->id};
  state_.view.state = ConfigurationState::kMoving;
  state_.view.waiting_for = "the camera";
  state_.out->exposure =
      MakeExposure(++exposure_, state_.now, state_.plane, state_.sectors, state_.Id());
  state_.Enter(PlanePhase::kMeasuring);
}

void PlaneRounds::TakeExposure(const ExposureDone& done) {
  PlaneView& view = state_.view;
  if (view.phase != PlanePhase::kMeasuring || done.id != exposure_) return;
  view.waiting_for.clear();
  tries_ = 0;
  view.not_measured = done.exposure ? std::string() : done.exposure.error().text;
  if (done.exposure) {
    const MeasuredRound round = SummaryOf(*done.exposure, *state_.record.under_way, state_.plane,
                                          state_.sectors, state_.Id());
    if (round.measured + round.unknown > 0) view.measured.push_back(round);
  }
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    if (!Looks(state_.sectors, sector, state_.Id())) continue;
    // A sector that asks for another one by now has not moved, and waits for the next.
    const SectorBook::Entry& entry = state_.sectors[sector];
    const PlanePart asked{entry.report->incarnation, entry.exposure->id};
    if (!(asked == parts_[sector])) continue;
    auto findings = std::make_shared<Result<ExposureFindings>>();
    if (done.exposure)
      *findings = PartOf(*done.exposure, state_.plane, sector, asked.job);
    else
      *findings = tl::unexpected(done.exposure.error());
    state_.sectors.Order(sector, {.kind = OrderKind::kFindings,
                                  .configuration = state_.Id(),
                                  .job = asked.job,
                                  .findings = std::move(findings)});
  }
  state_.Enter(PlanePhase::kGathering);
}

}  // namespace focalfleet
