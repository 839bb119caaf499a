// The unit's side of the protocol, and the code that a firmware starts from: a state machine driven
// by (frame, now) and by time alone. The machine needs no heap, no exceptions and no library. With
// the codec it compiles freestanding (a test holds it to that), with integers only and less than a
// KiB of state. The simulated units run exactly this code; firmware.h adds the planted faults.
//
// The machine answers every addressed request with exactly one frame, which carries the request's
// sequence number. Unasked it sends only the end of a motion (sequence 0). FLASH is written before
// the first step and after the last.
//
// A repeated frame never becomes a second move. The id of the move begun last stands in FLASH and
// is refused from then on. A repeated request that was granted is granted again without being done
// again.
//
//   stage_begin, stage_segment...   no answer; a repeated one changes nothing
//   confirm, arm                    answered by what is held; arm needs the digest of exactly that
//   start                           begins the armed move `delay_ticks` later, by its own clock
//   stop                            answered by `done`, whatever the unit was doing
//
// Reads may be broadcast, and every unit answers. Stop, start and clock are the only other
// broadcasts.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/instants.h"
#include "protocol/base/limits.h"
#include "protocol/wire/can_frame.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/stage_group.h"
#include "sim/world/unit/board.h"
#include "sim/world/unit/flash.h"
#include "sim/world/unit/homing.h"
#include "sim/world/unit/staging.h"
#include "sim/world/unit/transitions.h"
#include "sim/world/unit/transmit_queue.h"

namespace focalfleet::sim {

/// An edge of SYNC starts a move only within this time before its own start. Any other edge is
/// ignored.
inline constexpr DurationNs kSyncWindow = Milliseconds(20);

class UnitMachine {
 public:
  /// `board`'s context and `flash` outlive the machine; `flash` is what was read from FLASH.
  UnitMachine(NodeId node, const Board& board, Flash* flash);

  void PowerOn(BoardInstant now);
  /// The machine does and sends nothing until PowerOn.
  void PowerOff() { powered_ = false; }

  void OnFrame(const CanFrame& frame, BoardInstant now, TransmitQueue* out);
  /// Takes the unit's own entries of a group, as if each had come alone.
  void OnGroup(const FdFrame& group, BoardInstant now, TransmitQueue* out);
  /// Does everything that is due. Pre: now is not before any earlier instant.
  void OnTime(BoardInstant now, TransmitQueue* out);
  /// An edge of the SYNC line, on boards that have one. A move whose start is due within
  /// kSyncWindow of the unit's own time begins now. Pre: as OnTime, and OnTime was called.
  void OnSync(BoardInstant now);
  /// The instant at which OnTime is due next; kNever without power.
  [[nodiscard]] BoardInstant deadline() const;

  /// The fault that stops the unit at once and holds it in kFault until it is cleared.
  struct Trip {
    FaultCode code = FaultCode::kOverTemperature;
    Axis axis = Axis::kTheta;
  };
  void RaiseFault(const Trip& trip, BoardInstant now, TransmitQueue* out);

  [[nodiscard]] UnitState state() const { return state_; }
  [[nodiscard]] FaultCode fault() const { return trip_.code; }
  [[nodiscard]] bool powered() const { return powered_; }
  [[nodiscard]] bool interrupted() const;
  /// True while a motion runs; began_at() is its begin, and end_at() the end of its present path.
  [[nodiscard]] bool runs() const {
    return powered_ && (state_ == UnitState::kMoving || state_ == UnitState::kHoming);
  }
  [[nodiscard]] BoardInstant began_at() const { return motion_.began_at; }
  [[nodiscard]] BoardInstant end_at() const { return motion_.end_at; }
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }

 private:
  class RequestHandler;

  struct Granted {  // the last request of its kind that was granted
    bool any = false;
    CanFrame request;
  };
  struct Restart {
    bool unnoticed = false;       // powered on since the last request to resume
    bool reported = false;        // in the answer to the last resume, for its repetition
    std::uint32_t resume_id = 0;  // identifier of the last resume; 0: another request came since
  };
  struct Motion {
    BoardInstant begin_at = kNever;  // armed: the start signal came
    BoardInstant began_at;
    std::uint32_t began_ticks = 0;  // the same by the unit's own clock
    BoardInstant end_at = kNever;   // moving, homing: the end of the present path
  };
  struct SensorReading {
    std::array<std::uint16_t, limits::kSensorsPerUnit> counts{};
    bool valid = false;  // taken since the last motion began
  };

  void Enter(UnitState next);
  void SayDone(Outcome outcome, TransmitQueue* out);
  void Begin(BoardInstant now);
  void End(BoardInstant now, TransmitQueue* out);
  /// Both axes halt, FLASH takes the vectors that they show, and the mark is cleared (unless an
  /// axis is lost).
  void HaltAndStore(BoardInstant now);
  void LoseHost();
  [[nodiscard]] UnitState AtRest() const;

  NodeId node_;
  Board board_;
  Flash* flash_;
  UnitState state_ = UnitState::kRest;
  bool powered_ = false;
  bool host_lost_ = false;
  Restart restart_;
  Trip trip_{FaultCode::kNone, Axis::kTheta};
  std::uint16_t fault_count_ = 0;
  BoardInstant heard_at_;
  Motion motion_;
  Homing homing_;
  Staging staging_;
  Granted granted_arm_;
  Granted granted_home_;
  SensorReading reading_;
  std::uint64_t malformed_ = 0;
};

}  // namespace focalfleet::sim
