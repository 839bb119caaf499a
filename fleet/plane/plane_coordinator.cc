#include "fleet/plane/plane_coordinator.h"

#include <algorithm>
#include <utility>
#include <variant>

namespace focalfleet {

PlaneCoordinator::PlaneCoordinator(const PlaneLayout* plane, const PlaneTimes& times,
                                   std::uint64_t self, PlaneRecord kept)
    : state_{.plane = *plane,
             .times = times,
             .self = self,
             .record = std::move(kept),
             .sectors = SectorBook(plane, times)},
      rounds_(&state_),
      recall_(&state_),
      clock_watch_(times.clock_patience) {
  const PlaneRecord& record = state_.record;
  const auto& known = record.under_way ? record.under_way : record.last;
  if (!known) return;
  state_.view.configuration = known->id;
  state_.view.kind = known->kind;
  state_.view.source = known->source;
  state_.view.state = record.under_way ? ConfigurationState::kPlanning : record.last_state;
}

void PlaneCoordinator::Step(const PlaneInputs& inputs, PlaneEffects* effects) {
  state_.out = effects;
  state_.now = inputs.now;
  state_.kept = inputs.kept;
  if (state_.since.ns == INT64_MIN) state_.since = state_.now;
  for (const SectorReport& report : inputs.reports) state_.sectors.Hear(report, state_.now);
  state_.sectors.Look(state_.now);
  clock_watch_.Look(state_.sectors, state_.now, &state_.out->notes);
  const PlaneEpoch highest = state_.sectors.highest_accepted();
  const bool in_charge = state_.view.phase != PlanePhase::kListening;
  if (in_charge && state_.record.epoch < highest) {
    state_.out->log.push_back("another coordinator is in charge, epoch " +
                              std::to_string(highest.number) + ": this one gives no more orders");
    const Error took_over{ErrorCode::kUnavailable, "another coordinator took over"};
    state_.Reply(took_over, {});
    for (const Retargeting& one : std::exchange(retargetings_, {}))
      state_.out->replies.push_back({one.request, true, took_over, {}});
    state_.Enter(PlanePhase::kListening);
  }
  for (const PlanePlanDone& plan : inputs.plans) rounds_.TakePlan(plan);
  for (const ExposureDone& exposure : inputs.exposures) rounds_.TakeExposure(exposure);
  for (const PlaneCommand& command : inputs.commands) Obey(command);
  Proceed();
  recall_.Count();
  AnswerRetargets();
  const bool speaks =
      state_.view.phase != PlanePhase::kListening && state_.view.phase != PlanePhase::kClaiming;
  if (speaks)
    state_.out->wake_at =
        std::min(state_.out->wake_at, state_.sectors.Say(state_.now, &state_.out->orders));
  if (state_.view.phase != PlanePhase::kIdle)
    state_.out->wake_at = std::min(state_.out->wake_at, state_.now + state_.times.repeat);
  state_.out = nullptr;
}

void PlaneCoordinator::Proceed() {
  switch (state_.view.phase) {
    case PlanePhase::kListening:
      Listen();
      break;
    case PlanePhase::kClaiming:
      if (state_.IsKept()) Claim();
      break;
    case PlanePhase::kIdle:
      recall_.Idle();
      break;
    case PlanePhase::kRecording:
      if (state_.IsKept()) state_.Enter(PlanePhase::kGathering);
      break;
    case PlanePhase::kGathering:
      rounds_.Gather();
      break;
    case PlanePhase::kPlanning:
    case PlanePhase::kMeasuring:
      break;
    case PlanePhase::kPreparing:
      rounds_.Preparing();
      break;
    case PlanePhase::kMoving:
      rounds_.Moving();
      break;
    case PlanePhase::kFinishing:
      rounds_.Finishing();
      break;
    case PlanePhase::kStopping:
      rounds_.Stopping();
      break;
  }
}

// ---- who is in charge

void PlaneCoordinator::Listen() {
  state_.view.waiting_for = "the sectors";
  if (state_.now < state_.since + state_.times.listen) return;
  for (std::uint32_t sector = 0; sector < state_.sectors.size(); ++sector) {
    const SectorBook::Entry& entry = state_.sectors[sector];
    if (!state_.sectors.IsHeard(sector) || entry.report->accepted.number == 0) continue;
    if (entry.report->accepted.coordinator == state_.self) continue;
    if (entry.report->unordered < state_.times.takeover) {
      state_.view.waiting_for = "another coordinator, which is in charge";
      return;
    }
  }
  const PlaneEpoch highest = state_.sectors.highest_accepted();
  state_.record.epoch = {std::max(state_.record.epoch.number, highest.number) + 1, state_.self};
  state_.Keep();
  state_.Enter(PlanePhase::kClaiming);
}

void PlaneCoordinator::Claim() {
  state_.view.epoch = state_.record.epoch;
  state_.view.waiting_for.clear();
  state_.sectors.BeginEpoch(state_.record.epoch);
  state_.round = 0;
  state_.out->log.push_back("in charge of the plane, epoch " +
                            std::to_string(state_.record.epoch.number));
  state_.Enter(state_.record.under_way ? PlanePhase::kGathering : PlanePhase::kIdle);
}

// ---- commands

void PlaneCoordinator::Obey(const PlaneCommand& command) {
  const bool in_charge =
      state_.view.phase != PlanePhase::kListening && state_.view.phase != PlanePhase::kClaiming;
  const Status status =
      in_charge
          ? std::visit([&](const auto& what) { return Do(command.request, what); }, command.what)
          : Fail(ErrorCode::kRefused,
                 "this coordinator is not in charge: " + state_.view.waiting_for);
  if (!status) state_.out->replies.push_back({command.request, true, status.error(), {}});
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneStopCommand& /*command*/) {
  rounds_.Stop("stopped by the operator");
  state_.out->replies.push_back({request, true, {}, "done"});
  return {};
}

Status PlaneCoordinator::MayBegin() const {
  if (state_.record.under_way)
    return Fail(ErrorCode::kRefused, "configuration " +
                                         std::to_string(state_.record.under_way->id) + " (" +
                                         state_.record.under_way->source +
                                         ") is under way: stop it or wait until it ends");
  if (state_.view.phase != PlanePhase::kIdle)
    return Fail(ErrorCode::kRefused, "the plane is still stopping: try again in a moment");
  return {};
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneApplyCommand& command) {
  FOCALFLEET_TRY(MayBegin());
  FOCALFLEET_TRY_ASSIGN(PlaneConfiguration task, TaskOf(command, state_.plane));
  Begin(request, std::move(task));
  return {};
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneHomeCommand& command) {
  FOCALFLEET_TRY(MayBegin());
  FOCALFLEET_TRY_ASSIGN(PlaneConfiguration task, TaskOf(command, state_.plane, state_.sectors));
  Begin(request, std::move(task));
  return {};
}

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneMeasureCommand& /*command*/) {
  FOCALFLEET_TRY(MayBegin());
  Begin(request, MeasurementAfter(state_.record.last, state_.plane));
  return {};
}

void PlaneCoordinator::Begin(std::uint64_t request, PlaneConfiguration configuration) {
  configuration.id = state_.record.next_configuration++;
  state_.view = {.phase = state_.view.phase,
                 .epoch = state_.view.epoch,
                 .configuration = configuration.id,
                 .kind = configuration.kind,
                 .source = configuration.source,
                 .state = ConfigurationState::kPlanning};
  state_.record.under_way = std::move(configuration);
  rounds_.Begin();
  recall_.Begin();
  state_.request = request;
  state_.out->replies.push_back(
      {request, false, {}, "configuration " + std::to_string(state_.record.under_way->id)});
  state_.Keep();
  state_.Enter(PlanePhase::kRecording);
}

// ---- other targets

Status PlaneCoordinator::Do(std::uint64_t request, const PlaneRetargetCommand& command) {
  if (!busy()) return Fail(ErrorCode::kRefused, "no configuration is under way: apply one");
  PlaneConfiguration& configuration = *state_.record.under_way;
  if (state_.view.phase == PlanePhase::kStopping || state_.view.phase == PlanePhase::kFinishing)
    return Fail(ErrorCode::kRefused, "configuration " + std::to_string(configuration.id) +
                                         " is ending: apply another one");
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t change,
                        Retarget(command, state_.plane, state_.sectors, &configuration));
  retargetings_.push_back({request, change, command.unit});
  state_.Keep();
  return {};
}

/// A change is answered when its sector has it, or will not get it any more.
void PlaneCoordinator::AnswerRetargets() {
  std::erase_if(retargetings_, [&](const Retargeting& one) {
    const auto& report = state_.sectors[state_.plane.SectorOf(one.unit)].report;
    const std::string name =
        "unit " + std::to_string(state_.plane.layout().unit(one.unit).id.value);
    if (!state_.record.under_way) {
      state_.out->replies.push_back(
          {one.request,
           true,
           Error{ErrorCode::kUnavailable, "the configuration ended before " + name + " could go"},
           {}});
      return true;
    }
    if (!state_.IsKept() || !report || report->configuration != state_.Id() ||
        report->change < one.change)
      return false;
    state_.out->replies.push_back(
        {one.request, true, {}, name + " goes to its new target in the next round"});
    return true;
  });
}

}  // namespace focalfleet
