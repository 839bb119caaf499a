#include "fleet/plane/plane_coordinator.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
PlaneCoordinator::PlaneCoordinator(const PlaneLayout* plane, const PlaneTimes& times,
                                   std::uint64_t self, PlaneRecord kept)
    : plane_(*plane),
      times_(times),
      self_(self),
      record_(std::move(kept)),
      sectors_(plane, times),
      clock_watch_(times.clock_patience),
      told_(plane->sectors()),
      parts_(plane->sectors()) {
  if (record_.under_way) {
    view_.configuration = record_.under_way->id;
    view_.source = record_.under_way->source;
    view_.state = ConfigurationState::kPlanning;
  } else if (record_.last) {
    view_.configuration = record_.last->id;
    view_.source = record_.last->source;
    view_.state = record_.last_state;
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
      Idle();
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
      Moving();
      break;
    case PlanePhase::kFinishing:
      Finishing();
      break;
    case PlanePhase::kStopping:
      Stopping();
      break;
  }
  Count();
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

/// Sums what all sectors have told of the configuration. The word of a sector that has begun
/// another life since counts until that life knows better.
void PlaneCoordinator::Count() {
  const auto& configuration = record_.under_way ? record_.under_way : record_.last;
  if (!configuration) return;
  OutcomeCounts sum;
  for (const auto& target : configuration->targets) sum.targeted += target ? 1u : 0u;
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    const auto& report = sectors_[sector].report;
    const bool works = record_.under_way && report && report->configuration == Id();
    if (works || (report && report->last_over == Id())) told_[sector] = report->counts;
    const OutcomeCounts& counts = told_[sector];
    sum.arrived += counts.arrived;
    sum.refused += counts.refused;
    sum.failed += counts.failed;
    sum.stopped += counts.stopped;
    sum.unmeasured += counts.unmeasured;
  }
  view_.counts = sum;
}

/// Nothing is under way. A configuration that this coordinator does not know is stopped.
void PlaneCoordinator::Idle() {
  for (std::uint32_t sector = 0; sector < sectors_.size(); ++sector) {
    if (!sectors_.IsUsable(sector)) continue;
    const SectorReport& report = *sectors_[sector].report;
    const PlaneConfigurationId configuration = report.configuration;
    const bool knows_none = configuration.number == 0 && report.last_over.number == 0;
    if (record_.last && (configuration == Id() || knows_none))
      Recall(sector);
    else
      sectors_.Order(sector,
                     {.kind = configuration.number == 0 ? OrderKind::kStand : OrderKind::kStop,
                      .configuration = configuration});
  }
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
  told_.assign(sectors_.size(), {});
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

}  // namespace focalfleet
