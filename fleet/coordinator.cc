#include "fleet/coordinator.h"

#include <algorithm>

#include "fleet/coordinate/core.h"
#include "fleet/coordinate/executor.h"
#include "fleet/coordinate/unit_session.h"
#include "protocol/base/check.h"

namespace focalfleet {

class Coordinator::Impl {
 public:
  Impl(const Layout* layout, std::vector<UnitDrive> drives, const CoordinatorConfig& config,
       StoredFleet stored)
      : core_(layout, std::move(drives), config, std::move(stored)),
        sessions_(&core_),
        executor_(&core_, &sessions_) {}

  void Step(const Inputs& inputs, Effects* effects) {
    core_.BeginStep(inputs, effects);
    executor_.EndThoseOfAnEarlierRun();
    for (const ShellNote& note : inputs.notes) core_.Raise(note.severity, {}, {}, note.text);
    for (const RefusedRow& refused : inputs.refused) sessions_.StoreRefused(refused);
    for (const LinkEvent& link : inputs.links) sessions_.LinkChanged(link);
    for (const ReceivedFrame& received : inputs.frames) Hear(received);
    for (const PlanDone& plan : inputs.plans) executor_.OnPlan(plan);
    for (const ExposureDone& exposure : inputs.exposures) executor_.OnExposure(exposure);
    for (const Command& command : inputs.commands) Obey(command);
    while (const auto due = core_.NextDue()) static_cast<void>(sessions_.Service(*due));
    executor_.Advance();
    effects->wake_at = std::min(effects->wake_at, executor_.due());
    core_.EndStep();
  }

  void End(HostInstant now, Effects* effects) {
    core_.BeginStep({.now = now,
                     .frames = {},
                     .links = {},
                     .commands = {},
                     .plans = {},
                     .committed_through = core_.committed_through,
                     .store_failing = core_.store_failing},
                    effects);
    executor_.GiveUp();
    if (!effects->rows.empty()) effects->batch = core_.next_batch++;
  }

  Core& core() { return core_; }
  ConfigurationExecutor& executor() { return executor_; }

 private:
  void Hear(const ReceivedFrame& received) {
    BusRecord* bus = core_.FindBus(received.bus);
    FOCALFLEET_CHECK(bus != nullptr);  // the shell opens the buses of the layout and no others
    ++bus->view.frames_received;
    core_.heard_until = std::max(core_.heard_until, received.at);
    core_.Count(bus, {&received.frame, 1});
    const auto heard = DecodeUnit(received.frame);
    if (!heard) {
      // Another host may share the bus (a direct stop does): its frames are well formed and not for
      // us.
      if (!DecodeHost(received.frame)) ++bus->view.malformed;
      return;
    }
    const auto i = core_.layout.Find(received.bus, heard->address.node);
    if (!i) {
      ++bus->view.malformed;  // nobody of ours has this node number
      return;
    }
    const std::uint8_t sequence = heard->address.sequence;
    if (const auto* confirm = std::get_if<ConfirmReply>(&heard->message)) {
      if (core_.Answers(*i, Function::kConfirm, sequence)) executor_.OnConfirm(*i, *confirm);
    } else if (const auto* arm = std::get_if<ArmReply>(&heard->message)) {
      if (core_.Answers(*i, Function::kArm, sequence)) executor_.OnArm(*i, *arm);
    } else if (const auto* home = std::get_if<HomeReply>(&heard->message)) {
      if (core_.Answers(*i, Function::kHome, sequence)) executor_.OnHomeReply(*i, *home);
    } else {
      sessions_.Hear(*i, *heard, received.at);
    }
  }

  void Obey(const Command& command) {
    const Status status =
        std::visit([&](const auto& what) { return Do(command.request, what); }, command.what);
    if (!status) {
      core_.out->replies.push_back({command.request, true, status.error(), {}});
    } else if (std::holds_alternative<StopCommand>(command.what)) {
      core_.out->replies.push_back({command.request, true, {}, "done"});
    } else if (std::holds_alternative<EnableCommand>(command.what) ||
               std::holds_alternative<AdoptCommand>(command.what)) {
      core_.ReplyWhenDurable(command.request, "done");
    }  // the others go on and answer when they are over
  }

  Status Do(std::uint64_t request, const ApplyCommand& c) { return executor_.Apply(request, c); }
  Status Do(std::uint64_t request, const RetargetCommand& c) {
    return executor_.Retarget(request, c);
  }
  Status Do(std::uint64_t request, const HomeCommand& c) { return executor_.Home(request, c); }
  Status Do(std::uint64_t request, const MeasureCommand&) { return executor_.Measure(request); }
  Status Do(std::uint64_t, const StopCommand& c) {
    if (c.unit) {
      executor_.StopUnit(*c.unit);
    } else {
      executor_.StopAll();
    }
    return {};
  }
  Status Do(std::uint64_t, const EnableCommand& c) {
    for (const PositionerIndex i : c.units) {
      if (c.enabled && !core_.layout.unit(i).enabled)
        return Fail(ErrorCode::kRefused,
                    core_.NameOf(i) + " is disabled in the units file: change it there");
      if (IsUnderWay(core_.unit(i).view.phase) || IsLoaded(core_.unit(i).view.phase))
        return Fail(ErrorCode::kRefused, core_.NameOf(i) + " takes part in a configuration now");
    }
    sessions_.Enable(c);
    return {};
  }
  Status Do(std::uint64_t, const AdoptCommand& c) { return sessions_.Adopt(c.unit); }
  Status Do(std::uint64_t request, const WriteParameterCommand& c) {
    if (executor_.busy()) return Fail(ErrorCode::kRefused, "a configuration is under way");
    return sessions_.WriteParameter(request, c);
  }

  Status Do(std::uint64_t request, const KeepModelCommand& c) {
    core_.Note(c.row);
    core_.ReplyWhenDurable(request, "done");
    return {};
  }

  Core core_;
  UnitSessions sessions_;
  ConfigurationExecutor executor_;
};

void Effects::Clear() {
  batch = 0;
  rows.clear();
  frames.clear();
  plan_job.reset();
  exposure.reset();
  replies.clear();
  sync_at.reset();
  changed.clear();
  wake_at = kNever;
}

Coordinator::Coordinator(const Layout* layout, std::vector<UnitDrive> drives,
                         CoordinatorConfig config, StoredFleet stored)
    : impl_(std::make_unique<Impl>(layout, std::move(drives), config, std::move(stored))) {}
Coordinator::~Coordinator() = default;

void Coordinator::Step(const Inputs& inputs, Effects* effects) { impl_->Step(inputs, effects); }

void Coordinator::End(HostInstant now, Effects* effects) { impl_->End(now, effects); }

const UnitView& Coordinator::unit(PositionerIndex i) const { return impl_->core().unit(i).view; }

UnitKnowledge Coordinator::KnowledgeAt(PositionerIndex i, HostInstant now) const {
  const auto course = impl_->executor().CourseOf(i);
  const UnitView& view = unit(i);
  if (!course || view.phase != UnitPhase::kMoving) return view.knowledge;
  UnitKnowledge predicted;
  for (const Axis axis : kAxes)
    predicted[Index(axis)] =
        Exactly(Witness::kPredicted,
                PositionAt(course->plan->from[Index(axis)], course->plan->path[Index(axis)],
                           impl_->core().drives[i.value].axis[Index(axis)],
                           (now - course->began).seconds()));
  return predicted;
}

const BusView& Coordinator::bus(BusId bus) const {
  const BusRecord* record = impl_->core().FindBus(bus);
  FOCALFLEET_CHECK(record != nullptr);
  return record->view;
}

const ConfigurationView& Coordinator::configuration() const { return impl_->executor().view(); }
std::span<const UnitDrive> Coordinator::drives() const { return impl_->core().drives; }
const CoordinatorConfig& Coordinator::config() const { return impl_->core().config; }
bool Coordinator::busy() const { return impl_->executor().busy(); }

}  // namespace focalfleet
