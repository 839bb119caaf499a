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
    view_.kind = record_.under_way->kind;
    view_.source = record_.under_way->source;
    view_.state = ConfigurationState::kPlanning;
  } else if (record_.last) {
    view_.configuration = record_.last->id;
    view_.kind = record_.last->kind;
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
  for (const ExposureDone& exposure : inputs.exposures) TakeExposure(exposure);
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
    case PlanePhase::kMeasuring:
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
  AnswerRetargets();
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
  sum.targeted = static_cast<std::uint32_t>(configuration->to_home.size());
  if (configuration->kind == ConfigurationKind::kMeasure)
    for (const OutcomeCounts& told : told_) sum.targeted += told.targeted;
  else
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
    const bool tells = record_.last && record_.last->kind == ConfigurationKind::kApply;
    if (tells && (configuration == Id() || knows_none))
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
  const bool in_charge =
      view_.phase != PlanePhase::kListening && view_.phase != PlanePhase::kClaiming;
  const Status status =
      in_charge
          ? std::visit([&](const auto& what) { return Do(command.request, what); }, command.what)
          : Fail(ErrorCode::kRefused, "this coordinator is not in charge: " + view_.waiting_for);
  if (!status) out_->replies.push_back({command.request, true, status.error(), {}});
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneStopCommand& /*command*/) {
  Stop("stopped by the operator");
  out_->replies.push_back({request, true, {}, "done"});
  return {};
}

Status PlaneCoordinator::MayBegin() const {
  if (record_.under_way)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(record_.under_way->id) +
                                         " (" + record_.under_way->source +
                                         ") is under way: stop it or wait until it ends");
  if (view_.phase != PlanePhase::kIdle)
    return Fail(ErrorCode::kRefused, "the plane is still stopping: try again in a moment");
  return {};
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneApplyCommand& command) {
  FOCALFLEET_TRY(MayBegin());
  const std::size_t units = plane_.layout().size();
  if (command.targets.size() != units ||
      (!command.target_ids.empty() && command.target_ids.size() != units))
    return Fail(ErrorCode::kInvalid, "targets for another layout");
  Begin(request, {.source = command.source,
                  .fixed = command.fixed,
                  .targets = command.targets,
                  .target_ids = command.target_ids,
                  .measure = command.measure});
  return {};
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneHomeCommand& command) {
  FOCALFLEET_TRY(MayBegin());
  if (command.units.empty()) return Fail(ErrorCode::kInvalid, "no unit to home");
  PlaneConfiguration configuration{.source = "home",
                                   .targets = {},
                                   .target_ids = {},
                                   .kind = ConfigurationKind::kHome,
                                   .to_home = command.units,
                                   .unproven = command.unproven};
  configuration.targets.resize(plane_.layout().size());
  std::ranges::sort(configuration.to_home);
  const auto twice = std::ranges::unique(configuration.to_home);
  configuration.to_home.erase(twice.begin(), twice.end());
  if (configuration.to_home.back().value >= plane_.layout().size())
    return Fail(ErrorCode::kInvalid, "a unit to home that is none of this plane");
  for (const PositionerIndex i : configuration.to_home)
    if (const std::uint32_t sector = plane_.SectorOf(i); !sectors_.IsUsable(sector))
      return Fail(ErrorCode::kRefused, "unit " + std::to_string(plane_.layout().unit(i).id.value) +
                                           " is of " + NameOfSector(sector) + ", which " +
                                           sectors_[sector].trouble);
  Begin(request, std::move(configuration));
  return {};
}

/// Targets of the configuration before stay, so that errors can be reported.
Status PlaneCoordinator::Do(std::uint64_t request, const PlaneMeasureCommand& /*command*/) {
  FOCALFLEET_TRY(MayBegin());
  PlaneConfiguration configuration{
      .source = "measure", .targets = {}, .target_ids = {}, .kind = ConfigurationKind::kMeasure};
  configuration.targets.resize(plane_.layout().size());
  if (record_.last && record_.last->kind != ConfigurationKind::kHome)
    configuration.targets = record_.last->targets;
  Begin(request, std::move(configuration));
  return {};
}

void PlaneCoordinator::Begin(std::uint64_t request, PlaneConfiguration configuration) {
  configuration.id = record_.next_configuration++;
  view_ = {.phase = view_.phase,
           .epoch = view_.epoch,
           .configuration = configuration.id,
           .kind = configuration.kind,
           .source = configuration.source,
           .state = ConfigurationState::kPlanning};
  record_.under_way = std::move(configuration);
  told_.assign(sectors_.size(), {});
  tries_ = 0;
  request_ = request;
  out_->replies.push_back(
      {request, false, {}, "configuration " + std::to_string(record_.under_way->id)});
  Keep();
  Enter(PlanePhase::kRecording);
}

// ---- other targets

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneRetargetCommand& command) {
  if (!record_.under_way)
    return Fail(ErrorCode::kRefused, "no configuration is under way: apply one");
  PlaneConfiguration& configuration = *record_.under_way;
  const std::string name = "configuration " + std::to_string(configuration.id);
  if (configuration.kind != ConfigurationKind::kApply)
    return Fail(ErrorCode::kRefused, name + " (" + configuration.source + ") has no targets");
  if (view_.phase == PlanePhase::kStopping || view_.phase == PlanePhase::kFinishing)
    return Fail(ErrorCode::kRefused, name + " is ending: apply another one");
  if (command.unit.value >= plane_.layout().size())
    return Fail(ErrorCode::kInvalid, "another target for a unit that is none of this plane");
  const std::uint32_t sector = plane_.SectorOf(command.unit);
  if (!sectors_.IsUsable(sector))
    return Fail(ErrorCode::kRefused,
                "unit " + std::to_string(plane_.layout().unit(command.unit).id.value) + " is of " +
                    NameOfSector(sector) + ", which " + sectors_[sector].trouble);
  const std::uint64_t change =
      configuration.changes.empty() ? 1 : configuration.changes.rbegin()->first + 1;
  std::erase_if(configuration.changes,
                [&](const auto& earlier) { return earlier.second == command.unit; });
  configuration.changes.emplace(change, command.unit);
  configuration.targets[command.unit.value] = command.target;
  if (!configuration.target_ids.empty()) configuration.target_ids[command.unit.value].clear();
  retargetings_.push_back({request, change, command.unit});
  Keep();
  return {};
}

std::uint64_t PlaneCoordinator::LastChangeOf(std::uint32_t sector) const {
  if (!record_.under_way) return 0;
  std::uint64_t last = 0;
  for (const auto& [number, unit] : record_.under_way->changes)
    if (plane_.SectorOf(unit) == sector) last = number;
  return last;
}

PlaneOrder PlaneCoordinator::RetargetsOf(std::uint32_t sector) const {
  PlaneOrder order{.kind = OrderKind::kRetarget, .configuration = Id()};
  for (const auto& [number, unit] : record_.under_way->changes) {
    if (plane_.SectorOf(unit) != sector) continue;
    order.retargets.push_back(
        {number, {plane_.Local(unit), *record_.under_way->targets[unit.value]}});
    order.change = number;
  }
  return order;
}

/// A change is answered when its sector has it, or will not get it any more.
void PlaneCoordinator::AnswerRetargets() {
  std::erase_if(retargetings_, [&](const Retargeting& one) {
    const auto& report = sectors_[plane_.SectorOf(one.unit)].report;
    const std::string name = "unit " + std::to_string(plane_.layout().unit(one.unit).id.value);
    if (!record_.under_way) {
      out_->replies.push_back(
          {one.request,
           true,
           Error{ErrorCode::kUnavailable, "the configuration ended before " + name + " could go"},
           {}});
      return true;
    }
    if (kept_ != record_number_ || !report || report->configuration != Id() ||
        report->change < one.change)
      return false;
    out_->replies.push_back(
        {one.request, true, {}, name + " goes to its new target in the next round"});
    return true;
  });
}

void PlaneCoordinator::Reply(std::optional<Error> error, std::string text) {
  if (request_ == 0) return;
  out_->replies.push_back({std::exchange(request_, 0), true, std::move(error), std::move(text)});
}

}  // namespace focalfleet
