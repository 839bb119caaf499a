// The unit's side of the protocol: a state machine driven by (frame, now) and by time alone, and
// what a firmware starts from. It needs no heap, no exceptions, no library: it compiles
// freestanding with the codec (a test holds it to that), in less than a KiB of state, with integers
// only. The simulated units run exactly this code; what is theirs alone (planted faults) is
// firmware.h.
//
// It answers every
// addressed request with exactly one frame that carries the request's sequence number; it speaks
// unasked only to say that a motion ended (sequence 0). Its FLASH is written before the first step
// and after the last.
//
// What keeps a repeated frame from becoming a second move: the move begun last stands in FLASH, and
// that id is refused from then on; a repeated request that was granted is granted again without
// being done again.
//
//   stage_begin, stage_segment...   no answer; a repeated one changes nothing
//   confirm, arm                    answered by what is held; arm needs the digest of exactly that
//   start                           begins the armed move `delay_ticks` later, by the unit's own
//   clock stop                            answered by `done`, whatever the unit was doing
//
// Reads may be broadcast (every unit answers); of the rest only stop, start and clock.
#pragma once

#include <array>
#include <cstdint>

#include "protocol/base/instants.h"
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

/// An edge of SYNC means a start only so short before its own time; any other is none.
inline constexpr DurationNs kSyncWindow = Milliseconds(20);

class UnitMachine {
 public:
  /// `board`'s context and `flash` outlive the machine; `flash` is what was read from FLASH.
  UnitMachine(NodeId node, const Board& board, Flash* flash);

  void PowerOn(BoardInstant now);
  /// Nothing is done or said until PowerOn.
  void PowerOff() { powered_ = false; }

  void OnFrame(const CanFrame& frame, BoardInstant now, TransmitQueue* out);
  /// A CAN FD frame: of a group the unit's own entries, as if each had come alone.
  void OnGroup(const FdFrame& group, BoardInstant now, TransmitQueue* out);
  /// Does what is due. Pre: now is not before anything told so far.
  void OnTime(BoardInstant now, TransmitQueue* out);
  /// An edge of the SYNC line, on boards that have one: a move whose start is due within
  /// kSyncWindow of the unit's own time begins now. Pre: as OnTime, and OnTime was called.
  void OnSync(BoardInstant now);
  /// When OnTime is due next; kNever without power.
  [[nodiscard]] BoardInstant deadline() const;

  /// Stops at once and stays in kFault until the fault is cleared.
  struct Trip {
    FaultCode code = FaultCode::kOverTemperature;
    Axis axis = Axis::kTheta;
  };
  void RaiseFault(const Trip& trip, BoardInstant now, TransmitQueue* out);

  [[nodiscard]] UnitState state() const { return state_; }
  [[nodiscard]] FaultCode fault() const { return trip_.code; }
  [[nodiscard]] bool powered() const { return powered_; }
  [[nodiscard]] bool interrupted() const;
  /// Of the motion that runs: when it began, and when this path of it ends.
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
    BoardInstant end_at = kNever;   // moving, homing: of this path
  };
  struct SensorReading {
    std::array<std::uint16_t, limits::kSensorsPerUnit> counts{};
    bool valid = false;  // taken since the last motion began
  };

  void Enter(UnitState next);
  void SayDone(Outcome outcome, TransmitQueue* out);
  void Begin(BoardInstant now);
  void End(BoardInstant now, TransmitQueue* out);
  /// Both axes halt, FLASH takes what they show, the mark goes (unless an axis is lost).
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
