// Keeping in touch with every unit: find out who answers, read what it holds, reconcile that with
// the store, look after it while it rests and while it moves, and notice when it falls silent,
// restarts or fails.
//
// A unit is identified by seven questions in a row (identity, status, two vectors, two carrier
// counts, clock), about 14 frames of 140 bits: 100 units take 0.2 s of a 1 Mbit/s bus.
#pragma once

#include "fleet/coordinate/core.h"

namespace focalfleet {

class UnitSessions {
 public:
  explicit UnitSessions(Core* core) : core_(*core) {}

  /// A unit's timer ran out: repeat the open question, give up, or ask what its phase asks for.
  /// Phases of an upload belong to ConfigurationExecutor; this returns false for them when no
  /// question is open.
  bool Service(PositionerIndex i);

  /// One valid frame of a unit on its own bus, that had ended at `at`.
  void Hear(PositionerIndex i, const Addressed<UnitMessage>& heard, HostInstant at);

  void LinkChanged(const LinkEvent& event);

  /// Starts to read the unit anew; what was under way with it is over.
  void Identify(PositionerIndex i);
  /// The unit cannot be counted on: says so to all who need to know. `alarm` false where one alarm
  /// stands for many units.
  void Lose(PositionerIndex i, UnitPhase phase, const std::string& reason, bool alarm = true);

  /// The store set a row aside. Where it tells of a unit's place or binding, that unit is not moved
  /// until an operator enables it again; a command that wanted the row kept is told.
  void StoreRefused(const RefusedRow& refused);

  /// Reads the sensors of a unit that rests and has some: UnitRecord::sensing.
  void Sense(PositionerIndex i);

  /// Sets the count of a unit of unknown place to where it was found, to the vector that it shows
  /// (UnitRecord::locating until that is over). The unit does not move. Its place is known,
  /// `measured`, when both axes have taken it; else it stays unknown, with an alarm. Pre: kReady.
  void Locate(PositionerIndex i, const Pose& place);

  Status Adopt(PositionerIndex i);
  void Enable(const EnableCommand& command);
  /// Answered when the unit has, with the value that holds then.
  Status WriteParameter(std::uint64_t request, const WriteParameterCommand& command);

 private:
  void AskNext(PositionerIndex i);  // the next question of the identification
  [[nodiscard]] bool Belongs(PositionerIndex i);
  void NameExchange(PositionerIndex i);
  void Concluded(PositionerIndex i);
  /// See UnitRecord::unfit.
  [[nodiscard]] std::string MisfitOf(PositionerIndex i) const;
  void Unfit(PositionerIndex i);
  void Bind(PositionerIndex i);
  void Watch(PositionerIndex i);
  void MissSoon(PositionerIndex i);
  void NoAnswer(PositionerIndex i);
  void OnNoSerial(PositionerIndex i);
  void NotToBeRead(PositionerIndex i, const std::string& reason);
  void OnOtherVersion(PositionerIndex i, const IdentifyReply& identity);
  void OnStatus(PositionerIndex i, const StatusReply& status);
  void OnMotionStatus(PositionerIndex i, const StatusReply& status);
  void OnDone(PositionerIndex i, Done done, std::uint8_t sequence);
  void OnParameter(PositionerIndex i, const ParameterReply& reply);
  void OnClock(PositionerIndex i, const ClockReply& reply, HostInstant at);
  void ReportClock(PositionerIndex i, const ClockReply& reply);
  void OnSensors(PositionerIndex i, const SensorsReply& reply);
  void SensorsDoNotAnswer(PositionerIndex i, const std::string& what);
  void OnWritten(PositionerIndex i, const ParameterReply& reply);
  void WriteCount(PositionerIndex i);
  void OnCountWritten(PositionerIndex i, const ParameterReply& reply);
  void MotionEnded(PositionerIndex i, const Done& done);

  Core& core_;
};

}  // namespace focalfleet
