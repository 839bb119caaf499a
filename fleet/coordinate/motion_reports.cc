#include "fleet/coordinate/motion_reports.h"

#include <algorithm>
#include <string>

#include "fleet/coordinate/identification.h"
#include "fleet/coordinate/reconcile.h"
#include "fleet/coordinate/stall_detection.h"
#include "fleet/coordinate/unit_knowledge.h"

namespace focalfleet {
namespace {

using enum UnitPhase;

/// Sets when the unit counts as unheard. The instant comes early where the motion of others may
/// depend on its place before the question is given up.
void MissSoon(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  if (record.motion.seen_moving >= record.motion.watch_until) return;
  if (fleet.now() + fleet.requests.Patience() >= record.motion.watch_from)
    record.request.question->suspect_at = fleet.now() + StallDetectionOf(fleet.config).suspicion;
}

void OnMotionStatus(const Coordination& fleet, PositionerIndex i, const StatusReply& status) {
  const auto intent = fleet.ledger.intents.find(fleet.units[i].view.serial);
  const bool began = intent != fleet.ledger.intents.end() && status.move == intent->second.move;
  const bool turns = status.state == UnitState::kMoving || status.state == UnitState::kHoming;
  if (turns) {
    if (!began) return;
    fleet.units[i].motion.seen_moving = fleet.units[i].request.answered_asked;
    if (fleet.units[i].motion.wants_start) {
      fleet.requests.Ask(i, ClockRequest{});
      MissSoon(fleet, i);
    }
    return;
  }
  if (fleet.units[i].view.phase == kSettling) {
    Identify(fleet, i);  // a motion of an earlier run has ended
    return;
  }
  if (status.restarted || status.interrupted) {
    Identify(fleet, i);
    fleet.units.Report(i, UnitEventKind::kLost, "lost power in mid-move");
    fleet.ledger.alarms().Raise(AlarmName::kUnitLostPower, i, {},
                                fleet.units.NameOf(i) + " lost power in mid-move");
  } else if (!began && status.state == UnitState::kArmed &&
             fleet.units[i].request.answered_asked < fleet.units[i].motion.begun_by) {
    // The start signal may still be on its way. A unit that starts late within the notice is clear
    // of all others. If it never starts, the next answer may come too late to stop them.
    const StallDetection stall_detection = StallDetectionOf(fleet.config);
    const HostInstant start = fleet.units[i].motion.begun_by - fleet.config.poll_period;
    if (fleet.now() + stall_detection.poll + stall_detection.suspicion >=
        start + stall_detection.notice)
      fleet.units.Report(i, UnitEventKind::kUnheard);
    return;
  } else if (!began) {
    Identify(fleet, i);  // takes the move back, if it still holds one
    fleet.units.Report(i, UnitEventKind::kNeverBegan, "did not begin to move");
    fleet.ledger.alarms().Raise(AlarmName::kUnitNeverBegan, i, {},
                                fleet.units.NameOf(i) + " did not begin to move");
  } else {
    Identify(fleet, i);  // its own report was lost; its FLASH holds its place
    fleet.units.Report(i, UnitEventKind::kEnded);
  }
}

/// The unit has restarted, or lost the host, since it was read. Foreign hardware with an open move
/// is not resumed, and says so for longer.
bool IsNewlyLost(const UnitRecord& unit, const StatusReply& status) {
  if (unit.view.phase != kForeign) return status.restarted || status.host_lost;
  const bool knew_restart = unit.reading.not_resumed && unit.reading.status.restarted;
  const bool knew_loss = unit.reading.not_resumed && unit.reading.status.host_lost;
  return (status.restarted && !knew_restart) || (status.host_lost && !knew_loss);
}

/// A unit that restarted in mid-move answers a stop with the vectors in its FLASH, where the move
/// began. The same answer comes from a unit that was stopped before its first step; its status says
/// which one it is. A move may also end where it began, having made way for another unit.
bool CountsFromItsBeginning(const Done& done, const IntentRow& intent) {
  return (done.outcome == Outcome::kStopped || done.outcome == Outcome::kFault) &&
         done.position == intent.from;
}

void MotionEnded(const Coordination& fleet, PositionerIndex i, const Done& done) {
  UnitRecord& record = fleet.units[i];
  const IntentRow intent = fleet.ledger.intents.at(record.view.serial);
  const bool fault = done.outcome == Outcome::kFault;
  const bool arrived = done.position == intent.to && !fault;
  const bool homed = done.outcome == Outcome::kHomed;
  const bool cut_homing = record.view.phase == kHoming && !homed;
  fleet.requests.Forget(i);
  record.view.reported_state = fault ? UnitState::kFault : UnitState::kRest;
  if (cut_homing) {
    // The rotor may have met its stop and slipped while the vectors went on: they are no place.
    const auto& drive = fleet.drive(i).axis;
    Know(fleet, i, InterruptedHull(intent, {drive[0].subdivision, drive[1].subdivision}),
         Origin::kHoming);
  } else {
    Know(fleet, i, Exactly(Witness::kReported, done.position),
         homed ? Origin::kHoming : Origin::kMove);
  }
  fleet.ledger.EndIntent(fleet.units[i].view.serial, fault   ? IntentEnd::kFault
                                                     : homed ? IntentEnd::kHomed
                                                     : arrived && !cut_homing
                                                         ? IntentEnd::kArrived
                                                         : IntentEnd::kStopped);
  if (fault) {
    Lose(fleet, i, kFault, "stopped with a fault");
    return;
  }
  if (cut_homing) {
    fleet.units.Report(i, UnitEventKind::kStopped);
    Identify(fleet, i);
    return;
  }
  fleet.units.SetPhase(i, kReady);
  record.next_poll = fleet.now() + fleet.config.poll_period * kRestPollFactor;
  fleet.timers.Set(i, record.next_poll);
  if (record.motion.wants_start) fleet.requests.Ask(i, ClockRequest{});
  fleet.units.Report(i, arrived || homed ? UnitEventKind::kReady : UnitEventKind::kStopped);
}

}  // namespace

void PollSooner(const Coordination& fleet, PositionerIndex i) {
  UnitRecord& record = fleet.units[i];
  if (record.view.phase == kSettling) {
    const StallDetection pace = StallDetectionOf(fleet.config);
    record.next_poll = fleet.now() + pace.poll;
    record.request.question->suspect_at = fleet.now() + pace.suspicion;
    return;
  }
  // The watch lasts as long as the unit may have ended while that mattered.
  if (record.motion.seen_moving >= record.motion.watch_until) return;
  record.next_poll = std::min(
      record.next_poll,
      std::max(fleet.now() + StallDetectionOf(fleet.config).poll, record.motion.watch_from));
  MissSoon(fleet, i);
}

void OnStatus(const Coordination& fleet, PositionerIndex i, const StatusReply& status) {
  UnitRecord& record = fleet.units[i];
  UnitView& view = record.view;
  view.reported_state = status.state;
  view.fault = status.fault;
  view.move = status.move;
  fleet.units.Changed(i);
  if (view.phase == kIdentifying) {
    OnStatusRead(fleet, i, status);
    return;
  }
  if (IsUnderWay(view.phase)) {
    OnMotionStatus(fleet, i, status);
  } else if (IsNewlyLost(record, status) ||
             (view.phase == kFault) != (status.state == UnitState::kFault)) {
    if (view.phase == kReady && status.state == UnitState::kFault) {
      Lose(fleet, i, kFault, std::string("reports fault ") + Name(status.fault));
      record.trouble.named_fault = status.fault;
    } else {
      Identify(fleet, i);
    }
  } else if (view.phase == kFault) {
    NameFault(fleet, i, status.fault);
  } else if (view.phase == kReady) {
    fleet.requests.Ask(i, ClockRequest{});
  }
}

void OnDone(const Coordination& fleet, PositionerIndex i, Done done, std::uint8_t sequence) {
  UnitRecord& record = fleet.units[i];
  UnitView& view = record.view;
  done.position = fleet.units.PlaceAt(i, done.position);
  view.move = done.move;
  const bool answer = sequence != 0 && fleet.requests.Answers(i, Function::kDone, sequence);
  // A unit reports `stopped` only after a stop.
  if (done.outcome == Outcome::kStopped && !answer && !fleet.requests.MayAnswerOurStop(i, sequence))
    fleet.units.Report(i, UnitEventKind::kForeignStop);
  if (view.phase == kMoving || view.phase == kHoming) {
    const auto intent = fleet.ledger.intents.find(view.serial);
    if (intent != fleet.ledger.intents.end() && intent->second.move == done.move) {
      if (CountsFromItsBeginning(done, intent->second)) {
        Identify(fleet, i);
        fleet.units.Report(i, UnitEventKind::kEnded);
      } else {
        MotionEnded(fleet, i, done);
      }
    } else if (answer) {  // stopped before it began
      Identify(fleet, i);
      fleet.units.Report(i, UnitEventKind::kNeverBegan, "was stopped before it began");
    }
    return;
  }
  if (view.phase == kSettling) {
    Identify(fleet, i);
  } else if (IsLoaded(view.phase) && answer) {
    fleet.requests.Forget(i);
    fleet.units.SetPhase(i, kReady);
    fleet.timers.Set(i, record.next_poll = fleet.now() + fleet.config.poll_period);
    fleet.units.Report(i, UnitEventKind::kReady);
  } else if (view.phase == kReady && done.outcome == Outcome::kFault) {
    Lose(fleet, i, kFault, "reports a fault");
  } else if (view.phase == kSilent && answer) {  // it hears, and is read at once
    record.next_poll = fleet.now();
  }
}

}  // namespace focalfleet
