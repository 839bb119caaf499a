#include "fleet/coordinate/identification.h"

#include <optional>
#include <utility>

#include "fleet/coordinate/intents.h"
#include "fleet/coordinate/reconcile.h"
#include "fleet/coordinate/settling.h"
#include "fleet/coordinate/unit_knowledge.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

// The questions of an identification, in order. The first ones tell where the unit is.
constexpr int kSteps = 7;
constexpr int kStepsOfPlace = 4;
HostMessage StepQuestion(int step, bool resumes) {
  switch (step) {
    case 0:
      return IdentifyRequest{};
    case 1:
      return StatusRequest{.resume = resumes};
    case 2:
      return VectorRequest{Axis::kTheta};
    case 3:
      return VectorRequest{Axis::kPhi};
    case 4:
      return ParameterRead{Axis::kTheta, Parameter::kCounter1};
    case 5:
      return ParameterRead{Axis::kPhi, Parameter::kCounter1};
    default:
      return ClockRequest{};
  }
}

/// Raises an alarm where two places answer with each other's serial numbers: their cables, or the
/// robots themselves, were exchanged. The alarm comes once, when the second of them is read.
void NameExchange(const Coordination& fleet, PositionerIndex i) {
  const UnitView& view = fleet.units[i].view;
  const auto other = fleet.units.place_of.find(view.serial);
  if (other == fleet.units.place_of.end()) return;
  const PositionerIndex j = other->second;
  const UnitView& there = fleet.units[j].view;
  if (j == i || there.phase != kForeign || there.serial != view.bound_serial) return;
  const std::string id = std::to_string(fleet.layout.unit(i).id.value);
  const std::string other_id = std::to_string(fleet.layout.unit(j).id.value);
  fleet.ledger.alarms().Raise(
      AlarmName::kUnitsExchanged, i, {},
      "units " + other_id + " and " + id +
          " are exchanged: each answers with the other's serial number. Exchange their "
          "cables, or, if the robots themselves changed places, `focalfleet adopt " +
          other_id + "` and `focalfleet adopt " + id + "`");
}

void Bind(const Coordination& fleet, PositionerIndex i) {
  UnitView& view = fleet.units[i].view;
  const SerialNumber replaced = std::exchange(view.bound_serial, view.serial);
  fleet.units.place_of[view.serial] = i;
  fleet.ledger.Note(BindingRow{fleet.layout.unit(i).id, view.serial, replaced});
}

/// True where the unit is bound to its place, or is bound to it here. False: it is foreign there.
bool Belongs(const Coordination& fleet, PositionerIndex i) {
  UnitView& view = fleet.units[i].view;
  if (view.bound_serial.value == 0 && !fleet.units.place_of.contains(view.serial)) {
    Bind(fleet, i);
  } else if (view.bound_serial != view.serial) {
    view.knowledge = {};
    fleet.units.SetPhase(i, kForeign);
    fleet.ledger.alarms().Raise(
        AlarmName::kUnitForeign, i, {},
        fleet.units.NameOf(i) + " answers with serial number " + std::to_string(view.serial.value) +
            ", " + fleet.units.WhoseSerial(i) + ", not " + std::to_string(view.bound_serial.value) +
            ": it is not moved until it is adopted");
    NameExchange(fleet, i);
    fleet.units.Report(i, UnitEventKind::kLost, "has another serial number");
    return false;
  }
  fleet.ledger.alarms().End(AlarmName::kUnitForeign, i, {});
  fleet.ledger.alarms().End(AlarmName::kUnitsExchanged, i, {});
  return true;
}

std::string MisfitOf(const Coordination& fleet, PositionerIndex i) {
  const Reading& reading = fleet.units[i].reading;
  for (const Axis axis : kAxes) {
    const AxisDrive& drive = fleet.drive(i).axis[Index(axis)];
    const auto reported = [&](Parameter parameter, std::int32_t is, std::int32_t wanted) {
      return std::string(Name(axis)) + " " + Name(parameter) + " is " + std::to_string(is) +
             ", not " + std::to_string(wanted) + " as set";
    };
    if (reading.subdivision[Index(axis)] != drive.subdivision)
      return reported(Parameter::kSubdivision, reading.subdivision[Index(axis)], drive.subdivision);
    if (reading.counter1[Index(axis)] != drive.counter1)
      return reported(Parameter::kCounter1, reading.counter1[Index(axis)], drive.counter1);
  }
  return {};
}

/// Notes whether the unit's parameters differ from those of plans. False: its subdivision does.
bool IsReadable(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  const std::string unfit = MisfitOf(fleet, i);
  if (!unfit.empty() && unfit != record.trouble.unfit)
    fleet.ledger.alarms().Raise(AlarmName::kUnitUnfit, i, {},
                                fleet.units.NameOf(i) + " is not fit to move: " + unfit);
  if (unfit.empty()) fleet.ledger.alarms().End(AlarmName::kUnitUnfit, i, {});
  record.trouble.unfit = unfit;
  for (const Axis axis : kAxes)
    if (record.reading.subdivision[Index(axis)] != fleet.drive(i).axis[Index(axis)].subdivision)
      return false;
  return true;
}

void Unfit(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  fleet.units.SetPhase(i, kFault);
  record.next_poll = fleet.now() + fleet.config.poll_period * kRestPollFactor;
  fleet.timers.Set(i, record.next_poll);
  fleet.units.Report(i, UnitEventKind::kLost, "is not fit to move");
}

/// The unit has been read to the end, and is kReady or kFault afterwards.
void Finish(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  const bool ended_short = std::exchange(record.motion.ended_short, false);
  if (record.reading.status.state == UnitState::kFault) {
    fleet.units.SetPhase(i, kFault);
    const FaultCode code = record.reading.status.fault;
    if (fleet.ledger.alarms().Lasts(AlarmName::kUnitFault, i)) {
      NameFault(fleet, i, code);
    } else {
      fleet.ledger.alarms().Raise(
          AlarmName::kUnitFault, i, {},
          fleet.units.NameOf(i) + " is in fault" +
              (code == FaultCode::kNone ? "" : std::string(": ") + Name(code)));
      record.trouble.named_fault = code;
    }
    fleet.units.Report(i, UnitEventKind::kLost, "is in fault");
    return;
  }
  if (!record.trouble.unfit.empty() || !record.trouble.not_kept.empty()) {
    Unfit(fleet, i);
    return;
  }
  fleet.units.SetPhase(i, kReady);
  fleet.ledger.alarms().End(AlarmName::kUnitFault, i, {});
  fleet.units.Report(i, ended_short ? UnitEventKind::kStopped : UnitEventKind::kReady);
}

/// Closes the open move, for which others may have to stop.
void EndOpenMove(const Coordination& fleet, PositionerIndex i, IntentEnd end) {
  UnitRecord& record = fleet.units[i];
  const bool fault = record.reading.status.state == UnitState::kFault;
  const bool of_earlier_run = HasEarlierMove(fleet, i);
  fleet.ledger.EndIntent(record.view.serial,
                         end == IntentEnd::kStopped && fault ? IntentEnd::kFault : end);
  record.motion.ended_short = end != IntentEnd::kArrived;
  if (of_earlier_run && record.motion.ended_short) EndedEarly(fleet, i);
  // The `done` was lost, but the unit stands short of its end without a fault, and nothing but a
  // stop leaves it there.
  if (end == IntentEnd::kStopped && !fault && record.motion.runs_freely)
    fleet.units.Report(i, UnitEventKind::kForeignStop);
}

/// Puts the answers and the store side by side.
void SettlePlace(const Coordination& fleet, PositionerIndex i, const StoreSays& store) {
  UnitRecord& record = fleet.units[i];
  UnitView& view = record.view;
  const Reading& reading = record.reading;
  const Reconciled result = Reconcile(
      {reading.status, fleet.units.PlaceAt(i, reading.position), reading.subdivision}, store);
  if (result.intent_end) EndOpenMove(fleet, i, *result.intent_end);
  record.motion.runs_freely = false;
  if (!store.vector || store.vector->knowledge != result.knowledge)
    Know(fleet, i, result.knowledge, Origin::kMove);
  view.knowledge = result.knowledge;
  const bool was_known = !store.vector || IsPlace(store.vector->knowledge);
  if (IsPlace(result.knowledge)) fleet.ledger.alarms().End(AlarmName::kUnitPlaceLost, i, {});
  if (!IsPlace(result.knowledge) && (result.intent_end || was_known))
    fleet.ledger.alarms().Raise(AlarmName::kUnitPlaceLost, i, {},
                                fleet.units.NameOf(i) + ": position " +
                                    Name(result.knowledge[0].witness) + ", " + result.reason);
}

/// The unit is read anew, and resumed with that, when the store has what follows from its restart:
/// the daemon may end at any time, and the unit does not speak of it again. A row that the store
/// refuses is never there.
void IdentifyWhenStored(const Coordination& fleet, PositionerIndex i) {
  const UnitRecord& record = fleet.units[i];
  if (!record.trouble.not_kept.empty())
    Unfit(fleet, i);
  else if (fleet.ledger.committed_through() >= *record.reading.stored_by)
    Identify(fleet, i);
  else
    fleet.timers.Set(i, kNever);  // until WakeStored
}

/// All answers of the identification are there.
void Concluded(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  UnitView& view = record.view;
  const Reading& reading = record.reading;
  record.next_poll = fleet.now() + fleet.config.poll_period;
  fleet.timers.Set(i, record.next_poll);
  if (!Belongs(fleet, i)) return;
  StoreSays store;
  view.offset = {};
  if (const auto it = fleet.ledger.vectors.find(view.serial); it != fleet.ledger.vectors.end()) {
    store.vector = it->second;
    view.offset = it->second.offset;
  }
  if (const auto it = fleet.ledger.intents.find(view.serial); it != fleet.ledger.intents.end()) {
    store.intent = it->second;
    // An earlier run's intent does not say whether it homes.
    store.homes = it->second.to == HomeCountOf(fleet, i) &&
                  (!fleet.ledger.IsOfThisRun(it->second) ||
                   fleet.ledger.homing_configurations.contains(it->second.configuration));
    if (reading.status.state == UnitState::kMoving || reading.status.state == UnitState::kHoming) {
      view.knowledge = it->second.hull;
      BeginSettling(fleet, i);
      return;
    }
  } else if (reading.status.state == UnitState::kMoving ||
             reading.status.state == UnitState::kHoming) {
    view.knowledge = {};
    fleet.units.SetPhase(i, kSettling);
    return;
  }
  if (reading.not_resumed) {
    SettlePlace(fleet, i, store);
    record.reading.stored_by = fleet.ledger.BatchOfEnd(record.view.serial);
    fleet.units.awaiting_store.push_back(i);
    return IdentifyWhenStored(fleet, i);
  }
  if (!IsReadable(fleet, i)) {
    view.knowledge = {};  // its vectors are not the host's: no count of it is a place
    Unfit(fleet, i);
    return;
  }
  SettlePlace(fleet, i, store);
  Finish(fleet, i);
}

/// The unit answers and cannot be used: its identity alone is asked from now on.
void NotToBeRead(const Coordination& fleet, PositionerIndex i, const std::string& reason) {
  UnitRecord& record = fleet.units[i];
  record.view.knowledge = {};
  fleet.units.Changed(i);
  if (record.view.phase == kIdentifying) fleet.units.SetPhase(i, kAbsent);
  record.next_poll = fleet.now() + fleet.config.identify_period;
  fleet.timers.Set(i, record.next_poll);
  fleet.units.Report(i, UnitEventKind::kLost, reason);
}

/// The unit has another firmware, or is in its boot loader (version 0). Its place is not known any
/// more, and nothing but its identity is asked until its version is one that this host speaks.
void OnOtherVersion(const Coordination& fleet, PositionerIndex i, const IdentifyReply& identity) {
  UnitRecord& record = fleet.units[i];
  if (record.trouble.other_version != identity.protocol_version)
    fleet.ledger.alarms().Raise(AlarmName::kUnitOtherVersion, i, {},
                                fleet.units.NameOf(i) + " speaks protocol version " +
                                    std::to_string(identity.protocol_version) + ", not " +
                                    std::to_string(kProtocolVersion) + " or " +
                                    std::to_string(kProtocolVersionWithSensors) +
                                    ": it is not moved");
  record.trouble.other_version = identity.protocol_version;
  record.view.serial = identity.serial;
  NotToBeRead(fleet, i, "speaks another protocol version");
}

/// A unit without a serial number has lost its memory, or was never programmed. Nothing can be
/// stored of it. The unit is asked again, and not moved.
void OnNoSerial(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  if (!std::exchange(record.trouble.no_serial, true))
    fleet.ledger.alarms().Raise(
        AlarmName::kUnitWithoutSerial, i, {},
        fleet.units.NameOf(i) +
            " answers with serial number 0: its memory is lost, or it was never "
            "programmed; it is not moved");
  record.view.serial = {};
  NotToBeRead(fleet, i, "has no serial number");
}

}  // namespace

HostMessage FirstQuestion() { return StepQuestion(0, false); }

void AskNext(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  Reading& reading = record.reading;
  // The answer is taken as what was asked for, though the store may have the end by then.
  reading.resumes = fleet.ledger.HasEnd(record.view.serial) && record.trouble.not_kept.empty();
  if (reading.stored_by) {
    IdentifyWhenStored(fleet, i);
  } else if (reading.step < (reading.not_resumed ? kStepsOfPlace : kSteps)) {
    fleet.requests.Ask(i, StepQuestion(reading.step, reading.resumes));
  } else {
    Concluded(fleet, i);
  }
}

void Identify(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  fleet.requests.Forget(i);
  record.reading = {};
  record.sensing = {};
  record.locating.reset();
  record.motion.wants_start = false;
  record.clock_reported = false;
  fleet.units.SetPhase(i, kIdentifying);
  AskNext(fleet, i);
}

void WakeStored(const Coordination& fleet) {
  std::erase_if(fleet.units.awaiting_store, [&](PositionerIndex i) {
    const UnitRecord& record = fleet.units[i];
    const std::optional<std::uint64_t>& batch = record.reading.stored_by;
    if (record.view.phase != kIdentifying || !batch) return true;
    const bool is_over =
        fleet.ledger.committed_through() >= *batch || !record.trouble.not_kept.empty();
    if (is_over && !record.request.question) fleet.timers.Set(i, fleet.now());
    return is_over;
  });
}

void OnStatusRead(const Coordination& fleet, PositionerIndex i, const StatusReply& status) {
  UnitRecord& record = fleet.units[i];
  if (record.reading.stored_by) return;
  record.reading.status = status;
  record.reading.not_resumed = (status.restarted || status.host_lost) && !record.reading.resumes;
  ++record.reading.step;
  // A move that an earlier run staged and never started is taken back first.
  if (status.state == UnitState::kStaging || status.state == UnitState::kArmed)
    fleet.requests.Ask(i, Stop{});
}

void NameFault(const Coordination& fleet, PositionerIndex i, FaultCode fault) {
  FaultCode& named = fleet.units[i].trouble.named_fault;
  if (fault == FaultCode::kNone || fault == named ||
      !fleet.ledger.alarms().Lasts(AlarmName::kUnitFault, i))
    return;
  fleet.ledger.alarms().Explain(AlarmName::kUnitFault, i,
                                fleet.units.NameOf(i) + " is in fault: " + Name(fault));
  named = fault;
}

void Lose(const Coordination& fleet, PositionerIndex i, UnitPhase phase, const std::string& reason,
          bool alarm) {
  UnitRecord& record = fleet.units[i];
  const UnitPhase before = record.view.phase;
  const auto intent = fleet.ledger.intents.find(record.view.serial);
  if (intent != fleet.ledger.intents.end() && phase == kSilent) {
    // The unit may stand anywhere on its way. The intent stays open, so that more is known when the
    // unit answers again.
    const auto& drive = fleet.drive(i).axis;
    Know(fleet, i, InterruptedHull(intent->second, {drive[0].subdivision, drive[1].subdivision}),
         Origin::kMove);
  }
  if (phase == kSilent) LostOnItsWay(fleet, i);
  fleet.requests.Forget(i);
  record.locating.reset();
  record.motion.wants_start = false;
  fleet.units.SetPhase(i, phase);
  record.next_poll = fleet.now() + fleet.config.identify_period;
  fleet.timers.Set(i, record.next_poll);
  if (phase == kFault) record.trouble.named_fault = FaultCode::kNone;
  if (alarm)
    fleet.ledger.alarms().Raise(
        phase == kSilent ? AlarmName::kUnitSilent : AlarmName::kUnitFault, i, {},
        fleet.units.NameOf(i) + " " + reason + " (was " + Name(before) + ")");
  fleet.units.Report(i, UnitEventKind::kLost, reason);
}

void OnIdentity(const Coordination& fleet, PositionerIndex i, const IdentifyReply& identity) {
  UnitRecord& record = fleet.units[i];
  record.asked_once = true;
  fleet.ledger.alarms().End(AlarmName::kUnitSilent, i, {});
  if (!IsSpoken(identity.protocol_version)) return OnOtherVersion(fleet, i, identity);
  if (identity.serial.value == 0) return OnNoSerial(fleet, i);
  fleet.ledger.alarms().End(AlarmName::kUnitOtherVersion, i, {});
  fleet.ledger.alarms().End(AlarmName::kUnitWithoutSerial, i, {});
  record.trouble.no_serial = false;
  record.protocol_version = identity.protocol_version;
  record.trouble.other_version.reset();
  if (record.view.serial != identity.serial) {
    record.clock.Forget();
    // The place that was known is one of other hardware.
    if (identity.serial != record.view.bound_serial) record.view.knowledge = {};
  }
  record.view.serial = identity.serial;
  if (record.view.phase != kIdentifying) fleet.units.SetPhase(i, kIdentifying);
  record.reading.step = 1;
}

void OnVector(const Coordination& fleet, PositionerIndex i, const VectorReply& vector) {
  UnitRecord& record = fleet.units[i];
  if (record.view.phase != kIdentifying) return;
  record.reading.position[Index(vector.axis)] = vector.turns * vector.subdivision + vector.vector;
  record.reading.subdivision[Index(vector.axis)] = vector.subdivision;
  ++record.reading.step;
}

Status Adopt(const Coordination& fleet, PositionerIndex i) {
  UnitView& view = fleet.units[i].view;
  if (view.phase != kForeign)
    return Fail(ErrorCode::kRefused,
                fleet.units.NameOf(i) + " has nothing to adopt: its phase is " + Name(view.phase));
  if (const auto place = fleet.units.place_of.find(view.serial);
      place != fleet.units.place_of.end() && place->second != i) {
    const UnitView& there = fleet.units[place->second].view;
    if (there.serial == view.serial && there.phase != kAbsent && there.phase != kSilent)
      return Fail(ErrorCode::kRefused,
                  fleet.units.NameOf(place->second) + " answers with serial number " +
                      std::to_string(view.serial.value) +
                      ", too: which is which cannot be told; program one of them anew");
    // The hardware was moved here from another place; that place is empty now.
    fleet.units[place->second].view.bound_serial = {};
    fleet.ledger.Note(BindingRow{fleet.layout.unit(place->second).id, {}});
  }
  fleet.units.place_of.erase(view.bound_serial);
  Bind(fleet, i);
  // The outcome of the last configuration stays; the robot that answers there now is not the
  // reason.
  if (IsUnserved(view.outcome))
    view.outcome_reason = "it had not been adopted when the configuration ran";
  Identify(fleet, i);
  return {};
}

}  // namespace focalfleet
