#include "fleet/coordinator.h"

#include <algorithm>
#include <utility>
#include <variant>

#include "fleet/coordinate/bus_traffic.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/executor.h"
#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/preview.h"
#include "fleet/coordinate/refused_rows.h"
#include "fleet/coordinate/unit_parameters.h"
#include "fleet/coordinate/unit_session.h"
#include "protocol/base/check.h"

namespace focalfleet {

class Coordinator::Impl {
 public:
  Impl(const Layout* layout, std::vector<UnitDrive> drives, const CoordinatorConfig& config,
       StoredFleet stored)
      : config_(config),
        units_(*layout, std::move(drives), {config.bit_rate_bps, config.data_bit_rate_bps}, stored,
               step_),
        timers_(layout->size()),
        ledger_(*layout, config_, std::move(stored), step_),
        requests_(config_, step_, &units_, &timers_, ledger_.next_move()),
        traffic_(config_, step_, &units_),
        fleet_{*layout, config_, step_, units_, timers_, requests_, ledger_},
        sessions_(fleet_),
        executor_(fleet_) {
    for (std::uint32_t n = 0; n < units_.size(); ++n) timers_.Set({n}, {INT64_MIN});
  }

  void Step(const Inputs& inputs, Effects* effects) {
    BeginStep(inputs.now, inputs.committed_through, inputs.store_failing, effects);
    EndEarlierConfigurations(fleet_);
    for (const ShellNote& note : inputs.notes) {
      if (note.ends) ledger_.alarms().End(*note.ends, {}, {});
      ledger_.alarms().Raise(note.name, {}, {}, note.text);
    }
    for (const RefusedRow& refused : inputs.refused) StoreRefused(fleet_, refused);
    for (const LinkEvent& link : inputs.links) sessions_.LinkChanged(link);
    for (const ReceivedFrame& received : inputs.frames) Hear(received);
    for (const PlanDone& plan : inputs.plans) executor_.OnPlan(plan);
    for (const ExposureDone& exposure : inputs.exposures) executor_.OnExposure(exposure);
    for (const Command& command : inputs.commands) Obey(command);
    WakeStored(fleet_);
    while (const auto due = timers_.TakeDue(step_.now)) sessions_.Service(*due);
    executor_.Advance();
    effects->wake_at = std::min(effects->wake_at, executor_.due());
    ledger_.SendReplies();
    requests_.Release();
    traffic_.EndStep();
    effects->wake_at = std::min(effects->wake_at, timers_.earliest());
    ledger_.CloseBatch();
  }

  void End(HostInstant now, Effects* effects) {
    BeginStep(now, ledger_.committed_through(), ledger_.store_failing(), effects);
    executor_.GiveUp();
    ledger_.alarms().NoteAllFolded();
    ledger_.CloseBatch();
  }

  const UnitTable& units() const { return units_; }
  UnitTable& units() { return units_; }
  const CoordinatorConfig& config() const { return config_; }
  ConfigurationExecutor& executor() { return executor_; }

  /// Errors: kRefused where a command of a plane comes to a daemon of its own, or an operator's to
  /// a sector of a plane.
  [[nodiscard]] Status OfPlane(bool by_plane) const {
    if (by_plane == config_.in_plane) return {};
    return Fail(ErrorCode::kRefused, by_plane
                                         ? "this daemon is no sector of a plane"
                                         : "this daemon is one sector of a plane: its units move "
                                           "by the plane's coordinator, command that");
  }

 private:
  void BeginStep(HostInstant now, std::uint64_t committed_through, bool store_failing,
                 Effects* effects) {
    step_ = {.now = now, .out = effects};
    units_.BeginStep();
    ledger_.BeginStep(committed_through, store_failing);
  }

  void Hear(const ReceivedFrame& received) {
    BusRecord* bus = units_.FindBus(received.bus);
    FOCALFLEET_CHECK(bus != nullptr);  // the shell opens the buses of the layout and no others
    traffic_.CountHeard(received, bus);
    const auto heard = DecodeUnit(received.frame);
    if (!heard) {
      // Another host may share the bus (a direct stop does): its frames are well formed and not for
      // this host.
      if (!DecodeHost(received.frame)) ++bus->view.malformed;
      return;
    }
    const auto i = fleet_.layout.Find(received.bus, heard->address.node);
    if (!i) {
      ++bus->view.malformed;  // no unit of the layout has this node number
      return;
    }
    const std::uint8_t sequence = heard->address.sequence;
    if (const auto* confirm = std::get_if<ConfirmReply>(&heard->message)) {
      if (requests_.Answers(*i, Function::kConfirm, sequence)) executor_.OnConfirm(*i, *confirm);
    } else if (const auto* arm = std::get_if<ArmReply>(&heard->message)) {
      if (requests_.Answers(*i, Function::kArm, sequence)) executor_.OnArm(*i, *arm);
    } else if (const auto* progress = std::get_if<ProgressReply>(&heard->message)) {
      if (requests_.Answers(*i, Function::kProgress, sequence)) executor_.OnProgress(*i, *progress);
    } else if (const auto* home = std::get_if<HomeReply>(&heard->message)) {
      if (requests_.Answers(*i, Function::kHome, sequence)) executor_.OnHomeReply(*i, *home);
    } else {
      sessions_.Hear(*i, *heard, received.at);
    }
  }

  void Obey(const Command& command) {
    const Status status =
        std::visit([&](const auto& what) { return Do(command.request, what); }, command.what);
    if (!status) {
      step_.out->replies.push_back({command.request, true, status.error(), {}});
    } else if (std::holds_alternative<StopCommand>(command.what)) {
      step_.out->replies.push_back({command.request, true, {}, "done"});
    } else if (std::holds_alternative<EnableCommand>(command.what) ||
               std::holds_alternative<AdoptCommand>(command.what)) {
      ledger_.ReplyWhenDurable(command.request, "done");
    }  // other commands go on, and are answered when they are over
  }

  Status Do(std::uint64_t request, const ApplyCommand& c) {
    FOCALFLEET_TRY(OfPlane(false));
    return executor_.Apply(request, c);
  }
  Status Do(std::uint64_t request, const RetargetCommand& c) {
    FOCALFLEET_TRY(OfPlane(false));
    return executor_.Retarget(request, c);
  }
  Status Do(std::uint64_t request, const HomeCommand& c) {
    FOCALFLEET_TRY(OfPlane(false));
    return executor_.Home(request, c);
  }
  Status Do(std::uint64_t request, const MeasureCommand&) {
    FOCALFLEET_TRY(OfPlane(false));
    return executor_.Measure(request);
  }
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
      if (c.enabled && !fleet_.layout.unit(i).enabled)
        return Fail(ErrorCode::kRefused,
                    units_.NameOf(i) + " is disabled in the units file: change it there");
      if (IsUnderWay(units_[i].view.phase) || IsLoaded(units_[i].view.phase))
        return Fail(ErrorCode::kRefused, units_.NameOf(i) + " takes part in a configuration now");
    }
    sessions_.Enable(c);
    return {};
  }
  Status Do(std::uint64_t, const AdoptCommand& c) { return Adopt(fleet_, c.unit); }
  Status Do(std::uint64_t request, const WriteParameterCommand& c) {
    if (executor_.busy()) return Fail(ErrorCode::kRefused, "a configuration is under way");
    return WriteParameter(fleet_, request, c);
  }

  Status Do(std::uint64_t request, const SectorTask& c) {
    FOCALFLEET_TRY(OfPlane(true));
    if (const auto* home = std::get_if<HomeCommand>(&c.what)) return executor_.Home(request, *home);
    if (std::holds_alternative<MeasureCommand>(c.what)) return executor_.Measure(request);
    return executor_.Apply(request, std::get<ApplyCommand>(c.what));
  }
  /// The other commands of a plane.
  template <class OfRound>
  Status Do(std::uint64_t, const OfRound& c) {
    FOCALFLEET_TRY(OfPlane(true));
    return executor_.sector_rounds().Do(c);
  }

  Status Do(std::uint64_t request, const KeepRowsCommand& c) {
    for (const Row& row : c.rows) ledger_.Note(row);
    if (c.rows.empty())
      step_.out->replies.push_back({request, true, {}, c.text});
    else
      ledger_.ReplyWhenDurable(request, c.text);
    return {};
  }

  const CoordinatorConfig config_;
  StepState step_;
  UnitTable units_;
  UnitTimers timers_;
  Ledger ledger_;
  Requests requests_;
  BusTraffic traffic_;
  const Coordination fleet_;  // of the members above
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
  border_ends.clear();
  wake_at = kNever;
}

Coordinator::Coordinator(const Layout* layout, std::vector<UnitDrive> drives,
                         CoordinatorConfig config, StoredFleet stored)
    : impl_(std::make_unique<Impl>(layout, std::move(drives), config, std::move(stored))) {}
Coordinator::~Coordinator() = default;

void Coordinator::Step(const Inputs& inputs, Effects* effects) { impl_->Step(inputs, effects); }

void Coordinator::End(HostInstant now, Effects* effects) { impl_->End(now, effects); }

Result<Preview> Coordinator::PreviewOf(const ApplyCommand& command) const {
  FOCALFLEET_TRY(impl_->OfPlane(false));
  return impl_->executor().PreviewOf(command);
}

const UnitView& Coordinator::unit(PositionerIndex i) const { return impl_->units()[i].view; }

UnitKnowledge Coordinator::KnowledgeAt(PositionerIndex i, HostInstant now) const {
  const UnitView& view = unit(i);
  const UnitKnowledge* const before = impl_->executor().round().BeforeOf(i);
  if (before != nullptr && (view.phase == UnitPhase::kArmed || view.phase == UnitPhase::kReady))
    return *before;
  const auto course = impl_->executor().round().CourseOf(i);
  if (!course || view.phase != UnitPhase::kMoving) return view.knowledge;
  UnitKnowledge predicted;
  for (const Axis axis : kAxes)
    predicted[Index(axis)] =
        Exactly(Witness::kPredicted,
                PositionAt(course->plan->from[Index(axis)], course->plan->path[Index(axis)],
                           impl_->units().drives[i.value].axis[Index(axis)],
                           (now - course->began).seconds()));
  return predicted;
}

const BusView& Coordinator::bus(BusId bus) const {
  const BusRecord* record = impl_->units().FindBus(bus);
  FOCALFLEET_CHECK(record != nullptr);
  return record->view;
}

const ConfigurationView& Coordinator::configuration() const { return impl_->executor().view(); }
std::span<const UnitDrive> Coordinator::drives() const { return impl_->units().drives; }
const CoordinatorConfig& Coordinator::config() const { return impl_->config(); }
SectorView Coordinator::sector() const { return impl_->executor().sector_rounds().View(); }
bool Coordinator::busy() const { return impl_->executor().busy(); }

}  // namespace focalfleet
