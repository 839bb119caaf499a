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
#include "protocol/wire/staged_move.h"
#include "sim/world/unit/board.h"
#include "sim/world/unit/flash.h"
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
  [[nodiscard]] BoardInstant began_at() const { return began_at_; }
  [[nodiscard]] BoardInstant end_at() const { return end_at_; }
  [[nodiscard]] std::uint64_t malformed() const { return malformed_; }

 private:
  struct Context {
    Address address;
    BoardInstant now;
    const CanFrame* frame = nullptr;
    TransmitQueue* out = nullptr;
    [[nodiscard]] bool broadcast() const { return address.node == kBroadcastNode; }
  };
  struct Staged {
    StageBegin begin;  // move 0: nothing is staged
    std::array<std::array<Segment, limits::kSegmentsPerAxis>, kAxisCount> segments{};
    std::array<std::uint16_t, kAxisCount> received{};  // bit per index
  };
  struct Granted {  // the last request of its kind that was granted
    bool any = false;
    CanFrame request;
  };

  void On(const Stop& m, const Context& c);
  void On(const Start& m, const Context& c);
  void On(const Clock& m, const Context& c);
  void On(const ClockRequest& m, const Context& c);
  void On(const Arm& m, const Context& c);
  void On(const Confirm& m, const Context& c);
  void On(const StageBegin& m, const Context& c);
  void On(const StageSegment& m, const Context& c);
  void On(const Home& m, const Context& c);
  void On(const ProgressRequest& m, const Context& c);
  void On(const StatusRequest& m, const Context& c);
  void On(const VectorRequest& m, const Context& c);
  void On(const FaultRequest& m, const Context& c);
  void On(const IdentifyRequest& m, const Context& c);
  void On(const ParameterRead& m, const Context& c);
  void On(const ParameterWrite& m, const Context& c);
  void On(const SensorsRequest& m, const Context& c);

  void Enter(UnitState next);
  void Say(const UnitMessage& message, const Context& c);
  void SayDone(Outcome outcome, std::uint8_t sequence, TransmitQueue* out);
  void Begin(BoardInstant now);
  void End(BoardInstant now, TransmitQueue* out);
  /// Both axes halt, FLASH takes what they show, the mark goes (unless an axis is lost).
  void HaltAndStore(BoardInstant now);
  void RunHoming(Axis axis, BoardInstant now);
  void EndHomingAxis(BoardInstant now);
  void StoreCutHoming(BoardInstant now);
  void LoseHost();
  [[nodiscard]] UnitState AtRest() const;
  [[nodiscard]] Answer JudgeMove(MoveId move) const;
  [[nodiscard]] bool PathInRange() const;
  [[nodiscard]] StagedMove Held() const;
  [[nodiscard]] std::int32_t Position(Axis axis, BoardInstant now) const;
  [[nodiscard]] std::int32_t Read(Axis axis, Parameter parameter, BoardInstant now) const;
  [[nodiscard]] Answer Write(const ParameterWrite& m);
  [[nodiscard]] Answer WritePosition(Axis axis, std::int32_t value);
  [[nodiscard]] Answer WriteSubdivision(Axis axis, std::int32_t value);
  [[nodiscard]] std::uint8_t ProgressPercent(BoardInstant now) const;

  NodeId node_;
  Board board_;
  Flash* flash_;
  UnitState state_ = UnitState::kRest;
  bool powered_ = false;
  bool host_lost_ = false;
  bool restarted_ = false;
  bool restarted_reported_ = false;  // what the last resume was answered, for its repetition
  std::uint32_t resume_id_ = 0;      // identifier of the last resume; 0: something else came since
  Trip trip_{FaultCode::kNone, Axis::kTheta};
  std::uint16_t fault_count_ = 0;
  BoardInstant heard_at_;
  BoardInstant begin_at_ = kNever;  // armed: the start signal came
  BoardInstant began_at_;
  std::uint32_t began_ticks_ = 0;  // the same by the unit's own clock
  BoardInstant end_at_ = kNever;   // moving, homing: of this path
  Axis homing_axis_ = Axis::kPhi;
  std::uint8_t lost_before_homing_ = 0;
  Staged staged_;
  Granted granted_arm_;
  Granted granted_home_;
  std::array<std::uint16_t, limits::kSensorsPerUnit> counts_{};  // the last reading
  bool sensed_ = false;                                          // since the last motion began
  std::uint64_t malformed_ = 0;
};

}  // namespace focalfleet::sim
