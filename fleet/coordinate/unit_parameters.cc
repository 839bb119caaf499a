#include "fleet/coordinate/unit_parameters.h"

#include <string>
#include <utility>
#include <vector>

#include "fleet/coordinate/count_setting.h"
#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/unit_knowledge.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

void OnWritten(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = fleet.units[i];
  const std::uint64_t request = std::exchange(record.request.write_request, 0);
  const std::string what = std::string(Name(reply.axis)) + " " + Name(reply.parameter);
  if (reply.answer != Answer::kOk) {
    fleet.out().replies.push_back(
        {request,
         true,
         Error{ErrorCode::kRefused, fleet.units.NameOf(i) + " refuses it (" + Name(reply.answer) +
                                        "): " + what + " stays " + std::to_string(reply.value)},
         {}});
    return;
  }
  const ParameterRow row{record.view.serial, reply.axis, reply.parameter, reply.value,
                         Origin::kOperator};
  fleet.ledger.Note(row);
  fleet.ledger.ReplyWhenDurable(
      request, fleet.units.NameOf(i) + ": " + what + " = " + std::to_string(reply.value));
  TakeParameter(row, &fleet.units.drives[i.value]);
  if (reply.parameter == Parameter::kSubdivision || !record.trouble.unfit.empty())
    return Identify(fleet, i);
  if (reply.parameter == Parameter::kPosition) {
    UnitKnowledge knowledge = record.view.knowledge;
    knowledge[Index(reply.axis)] = Exactly(Witness::kReported, reply.value);
    record.view.offset[Index(reply.axis)] = 0;  // the operator has given its place
    Know(fleet, i, knowledge, Origin::kOperator);
  }
}

/// The unit rests, or a parameter may be what helps it.
bool TakesParameters(const UnitRecord& record) {
  return record.view.phase == kReady ||
         (record.view.phase == kFault && !record.trouble.unfit.empty());
}

}  // namespace

void OnParameter(const Coordination& fleet, PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = fleet.units[i];
  const AxisDrive& drive = fleet.drive(i).axis[Index(reply.axis)];
  if (record.view.phase == kIdentifying && reply.parameter == Parameter::kCounter1)
    record.reading.counter1[Index(reply.axis)] = reply.value;
  if (reply.written) {
    if (record.locating && reply.parameter == Parameter::kPosition)
      return OnCountWritten(fleet, i, reply);
    if (record.view.phase != kIdentifying) OnWritten(fleet, i, reply);
    // A misfit is read with every poll, and one alarm is enough.
    if (reply.answer != Answer::kOk && record.trouble.unfit.empty())
      fleet.ledger.alarms().Raise(
          AlarmName::kParameterRefused, i, {},
          fleet.units.NameOf(i) + " refuses " + Name(reply.parameter) + ": " + Name(reply.answer));
    return;
  }
  if (record.view.phase != kIdentifying) return;
  ++record.reading.step;
  if (reply.parameter == Parameter::kCounter1 && reply.value != drive.counter1)
    fleet.requests.Ask(i, ParameterWrite{reply.axis, Parameter::kCounter1, drive.counter1});
}

Status WriteParameter(const Coordination& fleet, std::uint64_t request,
                      const WriteParameterCommand& command) {
  UnitRecord& record = fleet.units[command.unit];
  std::vector<ParameterOrder>& waiting = record.request.waiting_writes;
  if (!TakesParameters(record) && record.view.phase != kIdentifying)
    return Fail(ErrorCode::kRefused, fleet.units.WhyNoParameters(command.unit));
  if (waiting.size() >= limits::kControlClients)  // each client has one, and most wait for it
    return Fail(ErrorCode::kFull, fleet.units.NameOf(command.unit) + " has " +
                                      std::to_string(waiting.size()) +
                                      " parameters to write already; go on when they are answered");
  waiting.push_back({request, {command.axis, command.parameter, command.value}});
  if (!record.request.question) fleet.timers.Set(command.unit, fleet.now());
  return {};
}

void WriteNext(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  if (!TakesParameters(record)) return fleet.units.RefuseWrites(i);
  std::vector<ParameterOrder>& waiting = record.request.waiting_writes;
  const ParameterOrder order = waiting.front();
  waiting.erase(waiting.begin());
  fleet.requests.Ask(i, order.write);
  record.request.write_request = order.request;
}

}  // namespace focalfleet
