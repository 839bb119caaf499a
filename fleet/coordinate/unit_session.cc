#include "fleet/coordinate/unit_session.h"

#include <utility>
#include <variant>

#include "fleet/coordinate/clock_answers.h"
#include "fleet/coordinate/count_setting.h"
#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/motion_reports.h"
#include "fleet/coordinate/sensor_reading.h"
#include "fleet/coordinate/settling.h"
#include "fleet/coordinate/unit_parameters.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

void NoAnswer(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  if (record.view.phase == kReady && record.sensing.under_way() &&
      record.request.question->answer_function == Function::kSensors) {
    fleet.requests.Forget(i);
    SensorsDoNotAnswer(fleet, i, "it does not report their readings");
    fleet.timers.Set(
        i, record.next_poll = fleet.now());  // the next poll shows whether it answers at all
    return;
  }
  fleet.requests.Forget(i);
  const bool is_first = !std::exchange(record.asked_once, true);
  if (is_first) LostOnItsWay(fleet, i);
  switch (record.view.phase) {
    case kAbsent:
    case kSilent:
      fleet.timers.Set(i, record.next_poll);
      return;
    case kIdentifying:
      if (record.view.serial.value == 0) {
        fleet.units.SetPhase(i, kAbsent);
        fleet.timers.Set(i, record.next_poll);
        return;
      }
      [[fallthrough]];
    default:
      Lose(fleet, i, kSilent, "does not answer");
  }
}

}  // namespace

void UnitSessions::Service(PositionerIndex i) {
  UnitRecord& record = fleet_.units[i];
  if (record.request.question) {
    if (fleet_.now() >= record.request.question->suspect_at) {
      record.request.question->suspect_at = kNever;
      fleet_.units.Report(i, UnitEventKind::kUnheard);
      if (record.view.phase == kSettling)
        StopSettlingNear(fleet_, i, "is not heard and may stand in its way");
    }
    if (fleet_.now() < record.request.question->deadline) {
      fleet_.timers.Set(i, record.request.question->deadline);
    } else if (!fleet_.requests.AskAgain(i)) {
      NoAnswer(fleet_, i);
    }
    return;
  }
  if (record.view.phase == kReady && record.sensing.under_way()) {
    AskSensors(fleet_, i);
    return;
  }
  if (record.view.phase == kReady && record.locating) {
    WriteCount(fleet_, i);
    return;
  }
  if (record.view.phase != kIdentifying && !record.request.waiting_writes.empty()) {
    WriteNext(fleet_, i);
    if (record.request.question) return;
  }
  const bool poll = fleet_.now() >= record.next_poll;
  switch (record.view.phase) {
    case kAbsent:
    case kSilent:
      if (poll) {
        record.next_poll = fleet_.now() + fleet_.config.identify_period;
        record.reading = {};
        fleet_.requests.Ask(i, FirstQuestion());
      } else {
        fleet_.timers.Set(i, record.next_poll);
      }
      return;
    case kIdentifying:
      AskNext(fleet_, i);
      if (record.view.phase != kIdentifying && !record.request.waiting_writes.empty() &&
          !record.request.question)
        fleet_.timers.Set(i, fleet_.now());  // it was read, and is served again
      return;
    case kForeign:
    case kFault:
    case kReady:
    case kMoving:
    case kHoming:
    case kSettling: {
      if (!poll) {
        fleet_.timers.Set(i, record.next_poll);
        return;
      }
      const bool moves = IsUnderWay(record.view.phase);
      record.next_poll = fleet_.now() + fleet_.config.poll_period * (moves ? 1 : kRestPollFactor);
      fleet_.requests.Ask(i, StatusRequest{});
      if (record.view.phase == kMoving || record.view.phase == kSettling) PollSooner(fleet_, i);
      return;
    }
    case kStaging:
    case kConfirming:
    case kArming:
    case kArmed:
      return;
  }
}

void UnitSessions::LinkChanged(const LinkEvent& event) {
  BusRecord* bus = fleet_.units.FindBus(event.bus);
  if (bus == nullptr) return;
  const LinkState before = bus->view.link;
  const std::string name = "bus " + std::to_string(event.bus.value);
  const std::string cause = event.cause.empty() ? "" : ": " + event.cause;
  if (before == event.state) {
    if (!cause.empty())
      fleet_.ledger.alarms().Raise(AlarmName::kBusTrouble, {}, event.bus, name + cause);
    return;
  }
  bus->view.link = event.state;
  if (event.state == LinkState::kUp || event.state == LinkState::kPassive)
    fleet_.ledger.alarms().End(AlarmName::kBusDown, {}, event.bus);
  if (event.state == LinkState::kUp) {
    fleet_.ledger.alarms().End(AlarmName::kBusPassive, {}, event.bus);
    fleet_.ledger.alarms().Raise(AlarmName::kBusUp, {}, event.bus, name + " is up");
    for (const PositionerIndex i : bus->units) {
      fleet_.units[i].next_poll = fleet_.now();
      if (!fleet_.units[i].request.question) fleet_.timers.Set(i, fleet_.now());
    }
    return;
  }
  if (event.state == LinkState::kPassive) {
    fleet_.ledger.alarms().Raise(AlarmName::kBusPassive, {}, event.bus,
                                 name + " is passive" + cause);
    return;
  }
  if (before == LinkState::kOff || before == LinkState::kDown) {
    fleet_.ledger.alarms().Raise(AlarmName::kBusDown, {}, event.bus,
                                 name + " is " + Name(event.state) + cause);
    return;
  }
  fleet_.ledger.alarms().Raise(AlarmName::kBusDown, {}, event.bus,
                               name + " is " + Name(event.state) + cause + "; its " +
                                   std::to_string(bus->units.size()) + " units cannot be reached");
  for (const PositionerIndex i : bus->units) {
    const UnitPhase phase = fleet_.units[i].view.phase;
    if (phase != kAbsent && phase != kSilent)
      Lose(fleet_, i, kSilent, "cannot be reached: " + name + " is " + Name(event.state), false);
  }
}

void UnitSessions::Hear(PositionerIndex i, const Addressed<UnitMessage>& heard, HostInstant at) {
  const std::uint8_t sequence = heard.address.sequence;
  const auto answers = [&](Function function) {
    return fleet_.requests.Answers(i, function, sequence);
  };

  if (const auto* done = std::get_if<Done>(&heard.message)) {
    OnDone(fleet_, i, *done, sequence);
  } else if (const auto* status = std::get_if<StatusReply>(&heard.message)) {
    if (answers(Function::kStatus)) OnStatus(fleet_, i, *status);
  } else if (const auto* identity = std::get_if<IdentifyReply>(&heard.message)) {
    if (answers(Function::kIdentify)) OnIdentity(fleet_, i, *identity);
  } else if (const auto* vector = std::get_if<VectorReply>(&heard.message)) {
    if (answers(Function::kVector)) OnVector(fleet_, i, *vector);
  } else if (const auto* parameter = std::get_if<ParameterReply>(&heard.message)) {
    if (answers(parameter->written ? Function::kParameterWrite : Function::kParameterRead))
      OnParameter(fleet_, i, *parameter);
  } else if (const auto* clock = std::get_if<ClockReply>(&heard.message)) {
    if (answers(Function::kClock)) OnClock(fleet_, i, *clock, at);
  } else if (const auto* sensors = std::get_if<SensorsReply>(&heard.message)) {
    if (answers(Function::kSensors)) OnSensors(fleet_, i, *sensors);
  } else if (std::holds_alternative<FaultReply>(heard.message)) {
    if (answers(Function::kFault)) Identify(fleet_, i);  // the clearing was all that was asked for
  }
}

void UnitSessions::Enable(const EnableCommand& command) {
  for (const PositionerIndex i : command.units) {
    UnitView& view = fleet_.units[i].view;
    view.enabled = command.enabled;
    view.disabled_reason = command.enabled ? "" : command.reason;
    fleet_.ledger.Note(EnableRow{fleet_.layout.unit(i).id, command.enabled, command.reason});
    fleet_.units.Changed(i);
    if (command.enabled) fleet_.units[i].trouble.not_kept.clear();
    if (command.enabled && view.phase == kFault)
      fleet_.requests.Ask(i, FaultRequest{.clear = true});
  }
}

}  // namespace focalfleet
