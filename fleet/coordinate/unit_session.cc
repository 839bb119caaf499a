#include "fleet/coordinate/unit_session.h"

#include <algorithm>
#include <utility>

#include "fleet/coordinate/reconcile.h"
#include "fleet/coordinate/stall_detection.h"
#include "protocol/base/check.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

// The questions of an identification, in order.
constexpr int kSteps = 7;
HostMessage StepQuestion(int step) {
  switch (step) {
    case 0:
      return IdentifyRequest{};
    case 1:
      return StatusRequest{.resume = true};
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

// Eight bytes, as long as they can get.
constexpr std::uint32_t kSensorsAnswerBits = 160;

// A resting unit is asked for its health ten times less often than a moving one for its progress.
constexpr std::int64_t kRestPollFactor = 10;

}  // namespace

bool UnitSessions::Service(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  if (record.question) {
    if (core_.now >= record.question->suspect_at) {
      record.question->suspect_at = kNever;
      core_.Tell(i, UnitEventKind::kUnheard);
    }
    if (core_.now < record.question->deadline) {
      core_.SetDue(i, record.question->deadline);
    } else if (!core_.AskAgain(i)) {
      NoAnswer(i);
    }
    return true;
  }
  if (record.view.phase == kReady && record.sensing.under_way()) {
    core_.Ask(i, SensorsRequest{record.sensing.next_part}, kSensorsAnswerBits);
    return true;
  }
  if (record.view.phase == kReady && record.locating) {
    WriteCount(i);
    return true;
  }
  const bool poll = core_.now >= record.next_poll;
  switch (record.view.phase) {
    case kAbsent:
    case kSilent:
      if (poll) {
        record.next_poll = core_.now + core_.config.identify_period;
        record.reading = {};
        core_.Ask(i, StepQuestion(0));
      } else {
        core_.SetDue(i, record.next_poll);
      }
      return true;
    case kIdentifying:
      AskNext(i);
      return true;
    case kForeign:
    case kFault:
    case kReady:
    case kMoving:
    case kHoming:
    case kSettling: {
      if (!poll) {
        core_.SetDue(i, record.next_poll);
        return true;
      }
      const bool moves = IsUnderWay(record.view.phase);
      record.next_poll = core_.now + core_.config.poll_period * (moves ? 1 : kRestPollFactor);
      core_.Ask(i, StatusRequest{});
      if (record.view.phase == kMoving) Watch(i);
      return true;
    }
    case kStaging:
    case kConfirming:
    case kArming:
    case kArmed:
      return false;
  }
  return false;
}

/// Others pass where it may stand: it is asked more often, and missed sooner.
void UnitSessions::Watch(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  // As long as it may have ended while that mattered.
  if (record.seen_moving >= record.watch_until) return;
  record.next_poll =
      std::min(record.next_poll,
               std::max(core_.now + StallDetectionOf(core_.config).poll, record.watch_from));
  MissSoon(i);
}

/// Its open question is to be missed in time, also where the answer may be awaited into the time in
/// which it matters.
void UnitSessions::MissSoon(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  if (record.seen_moving >= record.watch_until) return;
  if (core_.now + core_.Patience() >= record.watch_from)
    record.question->suspect_at = core_.now + StallDetectionOf(core_.config).suspicion;
}

void UnitSessions::AskNext(PositionerIndex i) {
  const Reading& reading = core_.unit(i).reading;
  if (reading.step < kSteps) {
    core_.Ask(i, StepQuestion(reading.step));
  } else {
    Concluded(i);
  }
}

void UnitSessions::Identify(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  core_.Forget(i);
  record.reading = {};
  record.sensing = {};
  record.locating.reset();
  record.wants_start = false;
  record.clock_reported = false;
  core_.SetPhase(i, kIdentifying);
  AskNext(i);
}

void UnitSessions::Lose(PositionerIndex i, UnitPhase phase, const std::string& reason, bool alarm) {
  UnitRecord& record = core_.unit(i);
  const UnitPhase before = record.view.phase;
  const auto intent = core_.intents.find(record.view.serial);
  if (intent != core_.intents.end() && phase == kSilent) {
    // It may stand anywhere on its way; the intent stays open, so that its return can tell more.
    const auto& drive = core_.drives[i.value].axis;
    core_.Know(i, InterruptedHull(intent->second, {drive[0].subdivision, drive[1].subdivision}),
               Origin::kMove);
  }
  core_.Forget(i);
  record.locating.reset();
  record.wants_start = false;
  core_.SetPhase(i, phase);
  record.next_poll = core_.now + core_.config.identify_period;
  core_.SetDue(i, record.next_poll);
  if (alarm)
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) + " " + reason + " (was " + Name(before) + ")");
  core_.Tell(i, UnitEventKind::kLost, reason);
}

void UnitSessions::NoAnswer(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  if (record.view.phase == kReady && record.sensing.under_way() &&
      record.question->answer_function == Function::kSensors) {
    core_.Forget(i);
    SensorsDoNotAnswer(i, "it does not tell them");
    core_.SetDue(i, record.next_poll = core_.now);  // whether it is there at all
    return;
  }
  core_.Forget(i);
  record.asked_once = true;
  switch (record.view.phase) {
    case kAbsent:
    case kSilent:
      core_.SetDue(i, record.next_poll);
      return;
    case kIdentifying:
      if (record.view.serial.value == 0) {
        core_.SetPhase(i, kAbsent);
        core_.SetDue(i, record.next_poll);
        return;
      }
      [[fallthrough]];
    default:
      Lose(i, kSilent, "does not answer");
  }
}

void UnitSessions::LinkChanged(const LinkEvent& event) {
  BusRecord* bus = core_.FindBus(event.bus);
  if (bus == nullptr) return;
  const LinkState before = bus->view.link;
  const std::string name = "bus " + std::to_string(event.bus.value);
  const std::string cause = event.cause.empty() ? "" : ": " + event.cause;
  if (before == event.state) {
    if (!cause.empty()) core_.Raise(Severity::kWarning, {}, event.bus, name + cause);
    return;
  }
  bus->view.link = event.state;
  if (event.state == LinkState::kUp) {
    core_.Raise(Severity::kInfo, {}, event.bus, name + " is up");
    for (const PositionerIndex i : bus->units) {
      core_.unit(i).next_poll = core_.now;
      if (!core_.unit(i).question) core_.SetDue(i, core_.now);
    }
    return;
  }
  if (event.state == LinkState::kPassive) {
    core_.Raise(Severity::kWarning, {}, event.bus, name + " is passive" + cause);
    return;
  }
  if (before == LinkState::kOff || before == LinkState::kDown) {
    core_.Raise(Severity::kWarning, {}, event.bus, name + " is " + Name(event.state) + cause);
    return;
  }
  core_.Raise(Severity::kError, {}, event.bus,
              name + " is " + Name(event.state) + cause + "; its " +
                  std::to_string(bus->units.size()) + " units cannot be reached");
  for (const PositionerIndex i : bus->units) {
    const UnitPhase phase = core_.unit(i).view.phase;
    if (phase != kAbsent && phase != kSilent)
      Lose(i, kSilent, "cannot be reached: " + name + " is " + Name(event.state), false);
  }
}

void UnitSessions::Hear(PositionerIndex i, const Addressed<UnitMessage>& heard, HostInstant at) {
  UnitRecord& record = core_.unit(i);
  const std::uint8_t sequence = heard.address.sequence;
  const auto answers = [&](Function function) { return core_.Answers(i, function, sequence); };

  if (const auto* done = std::get_if<Done>(&heard.message)) {
    OnDone(i, *done, sequence);
  } else if (const auto* status = std::get_if<StatusReply>(&heard.message)) {
    if (answers(Function::kStatus)) OnStatus(i, *status);
  } else if (const auto* identity = std::get_if<IdentifyReply>(&heard.message)) {
    if (!answers(Function::kIdentify)) return;
    record.asked_once = true;
    if (!IsSpoken(identity->protocol_version)) return OnOtherVersion(i, *identity);
    if (identity->serial.value == 0) return OnNoSerial(i);
    record.no_serial = false;
    record.protocol_version = identity->protocol_version;
    record.other_version.reset();
    if (record.view.serial != identity->serial) record.clock.Forget();
    record.view.serial = identity->serial;
    if (record.view.phase != kIdentifying) core_.SetPhase(i, kIdentifying);
    record.reading.step = 1;
  } else if (const auto* vector = std::get_if<VectorReply>(&heard.message)) {
    if (!answers(Function::kVector) || record.view.phase != kIdentifying) return;
    record.reading.position[Index(vector->axis)] =
        vector->turns * vector->subdivision + vector->vector;
    record.reading.subdivision[Index(vector->axis)] = vector->subdivision;
    ++record.reading.step;
  } else if (const auto* parameter = std::get_if<ParameterReply>(&heard.message)) {
    if (answers(parameter->written ? Function::kParameterWrite : Function::kParameterRead))
      OnParameter(i, *parameter);
  } else if (const auto* clock = std::get_if<ClockReply>(&heard.message)) {
    if (answers(Function::kClock)) OnClock(i, *clock, at);
  } else if (const auto* sensors = std::get_if<SensorsReply>(&heard.message)) {
    if (answers(Function::kSensors)) OnSensors(i, *sensors);
  } else if (std::holds_alternative<FaultReply>(heard.message)) {
    if (answers(Function::kFault)) Identify(i);  // asked only to clear it
  }
}

/// Another firmware, or a boot loader (version 0): nothing that was known of its place counts, and
/// nothing but its identity is asked until it speaks ours.
void UnitSessions::OnOtherVersion(PositionerIndex i, const IdentifyReply& identity) {
  UnitRecord& record = core_.unit(i);
  if (record.other_version != identity.protocol_version)
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) + " speaks protocol version " +
                    std::to_string(identity.protocol_version) + ", not " +
                    std::to_string(kProtocolVersion) + " or " +
                    std::to_string(kProtocolVersionWithSensors) + ": it is not moved");
  record.other_version = identity.protocol_version;
  record.view.serial = identity.serial;
  NotToBeRead(i, "speaks another protocol version");
}

/// Nothing can be kept of a unit without a serial number: its memory is lost, or it was never
/// programmed. It is asked again, and not moved.
void UnitSessions::OnNoSerial(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  if (!std::exchange(record.no_serial, true))
    core_.Raise(Severity::kError, i, {},
                core_.NameOf(i) +
                    " answers with serial number 0: its memory is lost, or it was never "
                    "programmed; it is not moved");
  record.view.serial = {};
  NotToBeRead(i, "has no serial number");
}

/// It answers, and is not one of ours: its identity alone is asked from now on.
void UnitSessions::NotToBeRead(PositionerIndex i, const std::string& reason) {
  UnitRecord& record = core_.unit(i);
  record.view.knowledge = {};
  core_.Changed(i);
  if (record.view.phase == kIdentifying) core_.SetPhase(i, kAbsent);
  record.next_poll = core_.now + core_.config.identify_period;
  core_.SetDue(i, record.next_poll);
  core_.Tell(i, UnitEventKind::kLost, reason);
}

void UnitSessions::OnStatus(PositionerIndex i, const StatusReply& status) {
  UnitRecord& record = core_.unit(i);
  UnitView& view = record.view;
  view.reported_state = status.state;
  view.fault = status.fault;
  view.move = status.move;
  core_.Changed(i);
  if (view.phase == kIdentifying) {
    record.reading.status = status;
    ++record.reading.step;
    // A move that an earlier run staged and never started is taken back before anything else.
    if (status.state == UnitState::kStaging || status.state == UnitState::kArmed)
      core_.Ask(i, Stop{});
    return;
  }
  if (IsUnderWay(view.phase)) {
    OnMotionStatus(i, status);
  } else if (status.restarted || status.host_lost ||
             (view.phase == kFault) != (status.state == UnitState::kFault)) {
    if (view.phase == kReady && status.state == UnitState::kFault)
      Lose(i, kFault, std::string("reports fault ") + Name(status.fault));
    else
      Identify(i);
  } else if (view.phase == kReady) {
    core_.Ask(i, ClockRequest{});
  }
}

void UnitSessions::OnMotionStatus(PositionerIndex i, const StatusReply& status) {
  const auto intent = core_.intents.find(core_.unit(i).view.serial);
  const bool began = intent != core_.intents.end() && status.move == intent->second.move;
  const bool turns = status.state == UnitState::kMoving || status.state == UnitState::kHoming;
  if (turns) {
    if (!began) return;
    core_.unit(i).seen_moving = core_.unit(i).answered_asked;
    if (core_.unit(i).wants_start) {
      core_.Ask(i, ClockRequest{});
      MissSoon(i);
    }
    return;
  }
  if (core_.unit(i).view.phase == kSettling) {
    Identify(i);  // a motion of an earlier run has ended
    return;
  }
  if (status.restarted || status.interrupted) {
    Identify(i);
    core_.Tell(i, UnitEventKind::kLost, "lost power in mid-move");
    core_.Raise(Severity::kError, i, {}, core_.NameOf(i) + " lost power in mid-move");
  } else if (!began && status.state == UnitState::kArmed &&
             core_.unit(i).answered_asked < core_.unit(i).begun_by) {
    // The start signal may still be on its way. Whoever starts late within the notice is clear of
    // all others; the next answer may come too late to stop them if it never starts.
    const StallDetection stall_detection = StallDetectionOf(core_.config);
    const HostInstant start = core_.unit(i).begun_by - core_.config.poll_period;
    if (core_.now + stall_detection.poll + stall_detection.suspicion >=
        start + stall_detection.notice)
      core_.Tell(i, UnitEventKind::kUnheard);
    return;
  } else if (!began) {
    Identify(i);  // takes the move back, if it still holds one
    core_.Tell(i, UnitEventKind::kNeverBegan, "did not begin to move");
    core_.Raise(Severity::kWarning, i, {}, core_.NameOf(i) + " did not begin to move");
  } else {
    Identify(i);  // its own report was lost; its FLASH says where it stands
    core_.Tell(i, UnitEventKind::kEnded);
  }
}

void UnitSessions::OnDone(PositionerIndex i, Done done, std::uint8_t sequence) {
  UnitRecord& record = core_.unit(i);
  UnitView& view = record.view;
  done.position = core_.PlaceAt(i, done.position);
  view.move = done.move;
  const bool answer = sequence != 0 && core_.Answers(i, Function::kDone, sequence);
  // A unit says `stopped` only to a stop.
  if (done.outcome == Outcome::kStopped && !answer && !core_.MayAnswerOurStop(i, sequence))
    core_.Tell(i, UnitEventKind::kForeignStop);
  if (view.phase == kMoving || view.phase == kHoming) {
    const auto intent = core_.intents.find(view.serial);
    if (intent != core_.intents.end() && intent->second.move == done.move) {
      MotionEnded(i, done);
    } else if (answer) {  // stopped before it began
      Identify(i);
      core_.Tell(i, UnitEventKind::kNeverBegan, "was stopped before it began");
    }
    return;
  }
  if (view.phase == kSettling) {
    Identify(i);
  } else if (IsLoaded(view.phase) && answer) {
    core_.Forget(i);
    core_.SetPhase(i, kReady);
    core_.SetDue(i, record.next_poll = core_.now + core_.config.poll_period);
    core_.Tell(i, UnitEventKind::kReady);
  } else if (view.phase == kReady && done.outcome == Outcome::kFault) {
    Lose(i, kFault, "reports a fault");
  }
}

void UnitSessions::MotionEnded(PositionerIndex i, const Done& done) {
  UnitRecord& record = core_.unit(i);
  const IntentRow intent = core_.intents.at(record.view.serial);
  const bool fault = done.outcome == Outcome::kFault;
  const bool arrived = done.position == intent.to && !fault;
  const bool homed = done.outcome == Outcome::kHomed;
  const bool cut_homing = record.view.phase == kHoming && !homed;
  core_.Forget(i);
  record.view.reported_state = fault ? UnitState::kFault : UnitState::kRest;
  if (cut_homing) {
    // The rotor may have met its stop and slipped while the vectors went on: they say nothing.
    const auto& drive = core_.drives[i.value].axis;
    core_.Know(i, InterruptedHull(intent, {drive[0].subdivision, drive[1].subdivision}),
               Origin::kHoming);
  } else {
    core_.Know(i, Exactly(Witness::kReported, done.position),
               homed ? Origin::kHoming : Origin::kMove);
  }
  core_.EndIntent(i, fault                    ? IntentEnd::kFault
                     : homed                  ? IntentEnd::kHomed
                     : arrived && !cut_homing ? IntentEnd::kArrived
                                              : IntentEnd::kStopped);
  if (fault) {
    Lose(i, kFault, "stopped with a fault");
    return;
  }
  if (cut_homing) {
    core_.Tell(i, UnitEventKind::kStopped);
    Identify(i);
    return;
  }
  core_.SetPhase(i, kReady);
  record.next_poll = core_.now + core_.config.poll_period * kRestPollFactor;
  core_.SetDue(i, record.next_poll);
  if (record.wants_start) core_.Ask(i, ClockRequest{});
  core_.Tell(i, arrived || homed ? UnitEventKind::kReady : UnitEventKind::kStopped);
}

void UnitSessions::OnParameter(PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = core_.unit(i);
  AxisDrive& drive = core_.drives[i.value].axis[Index(reply.axis)];
  if (record.view.phase == kIdentifying && reply.parameter == Parameter::kCounter1)
    record.reading.counter1[Index(reply.axis)] = reply.value;
  if (reply.written) {
    if (record.locating && reply.parameter == Parameter::kPosition) return OnCountWritten(i, reply);
    if (record.view.phase != kIdentifying) OnWritten(i, reply);
    // A misfit is read again and again.
    if (reply.answer != Answer::kOk && record.unfit.empty())
      core_.Raise(
          Severity::kWarning, i, {},
          core_.NameOf(i) + " refuses " + Name(reply.parameter) + ": " + Name(reply.answer));
    return;
  }
  if (record.view.phase != kIdentifying) return;
  ++record.reading.step;
  if (reply.parameter == Parameter::kCounter1 && reply.value != drive.counter1)
    core_.Ask(i, ParameterWrite{reply.axis, Parameter::kCounter1, drive.counter1});
}

void UnitSessions::OnWritten(PositionerIndex i, const ParameterReply& reply) {
  UnitRecord& record = core_.unit(i);
  const std::uint64_t request = std::exchange(record.write_request, 0);
  const std::string what = std::string(Name(reply.axis)) + " " + Name(reply.parameter);
  if (reply.answer != Answer::kOk) {
    core_.out->replies.push_back(
        {request,
         true,
         Error{ErrorCode::kRefused, core_.NameOf(i) + " refuses it (" + Name(reply.answer) +
                                        "): " + what + " stays " + std::to_string(reply.value)},
         {}});
    return;
  }
  const ParameterRow row{record.view.serial, reply.axis, reply.parameter, reply.value,
                         Origin::kOperator};
  core_.Note(row);
  core_.ReplyWhenDurable(request,
                         core_.NameOf(i) + ": " + what + " = " + std::to_string(reply.value));
  TakeParameter(row, &core_.drives[i.value]);
  if (reply.parameter == Parameter::kSubdivision || !record.unfit.empty()) return Identify(i);
  if (reply.parameter == Parameter::kPosition) {
    UnitKnowledge knowledge = record.view.knowledge;
    knowledge[Index(reply.axis)] = Exactly(Witness::kReported, reply.value);
    record.view.offset[Index(reply.axis)] = 0;  // the operator says where it stands
    core_.Know(i, knowledge, Origin::kOperator);
  }
}

void UnitSessions::Bind(PositionerIndex i) {
  UnitView& view = core_.unit(i).view;
  const SerialNumber replaced = std::exchange(view.bound_serial, view.serial);
  core_.place_of[view.serial] = i;
  core_.Note(BindingRow{core_.layout.unit(i).id, view.serial, replaced});
}

/// The unit is bound to its place, or is now; false: it is foreign there.
bool UnitSessions::Belongs(PositionerIndex i) {
  UnitView& view = core_.unit(i).view;
  const auto place = core_.place_of.find(view.serial);
  if (view.bound_serial.value == 0 && place == core_.place_of.end()) {
    Bind(i);
  } else if (view.bound_serial != view.serial) {
    view.knowledge = {};
    core_.SetPhase(i, kForeign);
    core_.Raise(Severity::kWarning, i, {},
                core_.NameOf(i) + " answers with serial number " +
                    std::to_string(view.serial.value) + ", " + core_.WhoseSerial(i) + ", not " +
                    std::to_string(view.bound_serial.value) +
                    ": it is not moved until it is adopted");
    NameExchange(i);
    core_.Tell(i, UnitEventKind::kLost, "has another serial number");
    return false;
  }
  return true;
}

/// Two places that answer with each other's serial numbers: their cables, or the robots themselves,
/// were exchanged. Said once, when the second of them is read.
void UnitSessions::NameExchange(PositionerIndex i) {
  const UnitView& view = core_.unit(i).view;
  const auto other = core_.place_of.find(view.serial);
  if (other == core_.place_of.end()) return;
  const PositionerIndex j = other->second;
  const UnitView& there = core_.unit(j).view;
  if (j == i || there.phase != kForeign || there.serial != view.bound_serial) return;
  const std::string id = std::to_string(core_.layout.unit(i).id.value);
  const std::string other_id = std::to_string(core_.layout.unit(j).id.value);
  core_.Raise(Severity::kError, i, {},
              "units " + other_id + " and " + id +
                  " are exchanged: each answers with the other's serial number. Exchange their "
                  "cables, or, if the robots themselves changed places, `focalfleet adopt " +
                  other_id + "` and `focalfleet adopt " + id + "`");
}

void UnitSessions::Concluded(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  UnitView& view = record.view;
  const Reading& reading = record.reading;
  record.next_poll = core_.now + core_.config.poll_period;
  core_.SetDue(i, record.next_poll);
  if (!Belongs(i)) return;
  StoreSays store;
  view.offset = {};
  if (const auto it = core_.stored_vectors.find(view.serial); it != core_.stored_vectors.end()) {
    store.vector = it->second;
    view.offset = it->second.offset;
  }
  if (const auto it = core_.intents.find(view.serial); it != core_.intents.end()) {
    store.intent = it->second;
    if (reading.status.state == UnitState::kMoving || reading.status.state == UnitState::kHoming) {
      view.knowledge = it->second.hull;
      core_.SetPhase(i, kSettling);
      return;
    }
  } else if (reading.status.state == UnitState::kMoving ||
             reading.status.state == UnitState::kHoming) {
    view.knowledge = {};
    core_.SetPhase(i, kSettling);
    return;
  }
  const std::string unfit = MisfitOf(i);
  if (!unfit.empty() && unfit != record.unfit)
    core_.Raise(Severity::kError, i, {}, core_.NameOf(i) + " is not fit to move: " + unfit);
  record.unfit = unfit;
  for (const Axis axis : kAxes) {
    if (reading.subdivision[Index(axis)] == core_.drives[i.value].axis[Index(axis)].subdivision)
      continue;
    view.knowledge = {};  // its vectors are not the host's: nothing that it says is a place
    Unfit(i);
    return;
  }
  const Reconciled result =
      Reconcile({reading.status, core_.PlaceAt(i, reading.position), reading.subdivision}, store);
  if (result.intent_end) core_.EndIntent(i, *result.intent_end);
  // Its `done` was lost, but it stands short of its end, and nothing but a stop leaves it there.
  if (result.intent_end == IntentEnd::kStopped && record.runs_freely)
    core_.Tell(i, UnitEventKind::kForeignStop);
  record.runs_freely = false;
  if (!store.vector || store.vector->knowledge != result.knowledge)
    core_.Know(i, result.knowledge, Origin::kMove);
  view.knowledge = result.knowledge;
  const bool was_known = !store.vector || IsPlace(store.vector->knowledge);
  if (!IsPlace(result.knowledge) && (result.intent_end || was_known))
    core_.Raise(
        Severity::kWarning, i, {},
        core_.NameOf(i) + ": position " + Name(result.knowledge[0].witness) + ", " + result.reason);
  if (reading.status.state == UnitState::kFault) {
    core_.SetPhase(i, kFault);
    core_.Tell(i, UnitEventKind::kLost, "is in fault");
    return;
  }
  if (!unfit.empty() || !record.not_kept.empty()) {
    Unfit(i);
    return;
  }
  core_.SetPhase(i, kReady);
  const bool short_of_its_end = result.intent_end && *result.intent_end != IntentEnd::kArrived;
  core_.Tell(i, short_of_its_end ? UnitEventKind::kStopped : UnitEventKind::kReady);
}

std::string UnitSessions::MisfitOf(PositionerIndex i) const {
  const Reading& reading = core_.units[i.value].reading;
  for (const Axis axis : kAxes) {
    const AxisDrive& drive = core_.drives[i.value].axis[Index(axis)];
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

void UnitSessions::Unfit(PositionerIndex i) {
  UnitRecord& record = core_.unit(i);
  core_.SetPhase(i, kFault);
  record.next_poll = core_.now + core_.config.poll_period * kRestPollFactor;
  core_.SetDue(i, record.next_poll);
  core_.Tell(i, UnitEventKind::kLost, "is not fit to move");
}

Status UnitSessions::Adopt(PositionerIndex i) {
  UnitView& view = core_.unit(i).view;
  if (view.phase != kForeign)
    return Fail(ErrorCode::kRefused,
                core_.NameOf(i) + " has nothing to adopt: its phase is " + Name(view.phase));
  if (const auto place = core_.place_of.find(view.serial);
      place != core_.place_of.end() && place->second != i) {
    const UnitView& there = core_.unit(place->second).view;
    if (there.serial == view.serial && there.phase != kAbsent && there.phase != kSilent)
      return Fail(ErrorCode::kRefused,
                  core_.NameOf(place->second) + " answers with serial number " +
                      std::to_string(view.serial.value) +
                      ", too: which is which cannot be told; program one of them anew");
    // The hardware was moved here from another place; that place is empty now.
    core_.unit(place->second).view.bound_serial = {};
    core_.Note(BindingRow{core_.layout.unit(place->second).id, {}});
  }
  core_.place_of.erase(view.bound_serial);
  Bind(i);
  // What came of the last configuration stays; the robot that answers there now is not the reason.
  if (IsUnserved(view.outcome))
    view.outcome_reason = "it had not been adopted when the configuration ran";
  Identify(i);
  return {};
}

void UnitSessions::Enable(const EnableCommand& command) {
  for (const PositionerIndex i : command.units) {
    UnitView& view = core_.unit(i).view;
    view.enabled = command.enabled;
    view.disabled_reason = command.enabled ? "" : command.reason;
    core_.Note(EnableRow{core_.layout.unit(i).id, command.enabled, command.reason});
    core_.Changed(i);
    if (command.enabled) core_.unit(i).not_kept.clear();
    if (command.enabled && view.phase == kFault) core_.Ask(i, FaultRequest{.clear = true});
  }
}

Status UnitSessions::WriteParameter(std::uint64_t request, const WriteParameterCommand& command) {
  const UnitRecord& record = core_.unit(command.unit);
  const UnitPhase phase = record.view.phase;
  const bool misfit = phase == kFault && !record.unfit.empty();  // a parameter may help it
  if ((phase != kReady && !misfit) || record.question)
    return Fail(
        ErrorCode::kRefused,
        core_.NameOf(command.unit) + " takes parameters only at rest; its phase is " + Name(phase));
  core_.Ask(command.unit, ParameterWrite{command.axis, command.parameter, command.value});
  core_.unit(command.unit).write_request = request;
  return {};
}

}  // namespace focalfleet
