#include "sim/world/unit/unit_machine.h"

#include <algorithm>

#include "protocol/base/check.h"
#include "sim/world/unit/places.h"

namespace focalfleet::sim {
UnitMachine::UnitMachine(NodeId node, const Board& board, Flash* flash)
    : node_(node), board_(board), flash_(flash) {}

// ---- power and time

void UnitMachine::PowerOn(BoardInstant now) {
  if (powered_) return;
  *this = UnitMachine(node_, board_, flash_);
  powered_ = true;
  restarted_ = true;
  heard_at_ = now;
  Flash& flash = *flash_;
  if (flash.moving && flash.lost_axes == 0) {
    flash.lost_axes = kBothAxes;
    board_.keep(board_.context);
  }
  for (const Axis axis : kAxes) {
    const AxisFlash& stored = flash.axis[Index(axis)];
    board_.energise(board_.context, axis, {stored.position(), stored.subdivision});
  }
}

BoardInstant UnitMachine::deadline() const {
  if (!powered_) return kNever;
  BoardInstant due = std::min(begin_at_, end_at_);
  if (!host_lost_) {
    const DurationNs timeout = Milliseconds(flash_->host_timeout_ms);
    due = std::min(due, board_.after(board_.context, heard_at_, timeout));
  }
  return due;
}

void UnitMachine::OnTime(BoardInstant now, TransmitQueue* out) {
  if (!powered_) return;
  if (begin_at_ <= now) Begin(begin_at_);
  while (end_at_ <= now) End(end_at_, out);
  if (!host_lost_ && deadline() <= now) LoseHost();
}

void UnitMachine::OnSync(BoardInstant now) {
  if (!powered_ || begin_at_ == kNever) return;
  if (begin_at_ <= board_.after(board_.context, now, kSyncWindow)) Begin(now);
}

void UnitMachine::LoseHost() {
  host_lost_ = true;
  // A motion that runs, and one whose start signal came, are finished first.
  if (state_ == UnitState::kRest || state_ == UnitState::kStaging ||
      (state_ == UnitState::kArmed && begin_at_ == kNever)) {
    staged_ = {};
    Enter(UnitState::kHostLost);
  }
}

UnitState UnitMachine::AtRest() const {
  return host_lost_ ? UnitState::kHostLost : UnitState::kRest;
}

void UnitMachine::Enter(UnitState next) {
  FOCALFLEET_CHECK(Allowed(state_, next));
  state_ = next;
}

// ---- motion

void UnitMachine::Begin(BoardInstant now) {
  Flash& flash = *flash_;
  FOCALFLEET_CHECK(state_ == UnitState::kArmed && staged_.begin.move != flash.last_begun);
  flash.moving = true;
  flash.last_begun = staged_.begin.move;
  ++flash.moves_begun;
  board_.keep(board_.context);  // before the first step
  const StagedMove held = Held();
  staged_ = {};
  sensed_ = false;
  begin_at_ = kNever;
  began_at_ = end_at_ = now;
  began_ticks_ = board_.ticks(board_.context, now);
  for (const Axis axis : kAxes) {
    const AxisFlash& stored = flash.axis[Index(axis)];
    const auto segments = held.path[Index(axis)].segments();
    const BoardInstant end =
        board_.run(board_.context, axis,
                   {stored.position(), now, stored.counter1, segments.data(), segments.size()});
    end_at_ = std::max(end_at_, end);
  }
  Enter(UnitState::kMoving);
}

void UnitMachine::HaltAndStore(BoardInstant now) {
  Flash& flash = *flash_;
  for (const Axis axis : kAxes) {
    board_.halt(board_.context, axis, now);
    flash.axis[Index(axis)].set_position(board_.applied(board_.context, axis, now));
  }
  if (state_ == UnitState::kHoming) StoreCutHoming(now);
  flash.moving = flash.lost_axes != 0;
  board_.keep(board_.context);
  end_at_ = kNever;
}

void UnitMachine::End(BoardInstant now, TransmitQueue* out) {
  if (state_ == UnitState::kHoming) {
    EndHomingAxis(now);
    if (homing_axis_ == Axis::kPhi) return RunHoming(Axis::kTheta, now);
    flash_->moving = false;
    board_.keep(board_.context);
    end_at_ = kNever;
    Enter(AtRest());
    return SayDone(Outcome::kHomed, 0, out);
  }
  HaltAndStore(now);
  Enter(AtRest());
  SayDone(Outcome::kArrived, 0, out);
}

// Drives over the whole range and two turns more, so that the axis reaches its stop from anywhere,
// and ends on the vector that the stop shows.
void UnitMachine::RunHoming(Axis axis, BoardInstant now) {
  homing_axis_ = axis;
  const AxisFlash& stored = flash_->axis[Index(axis)];
  const std::int32_t range = stored.max_position - stored.min_position;
  const bool up = stored.max_position - stored.home_position <= range / 2;
  const std::int32_t sign = up ? 1 : -1;
  std::int32_t way = range + range / 20 + 2 * stored.subdivision;
  way += FloorMod(sign * (stored.home_position - stored.position()) - way, stored.subdivision);
  // One segment carries 24 bits of way; two of them carry any range.
  const std::int32_t half = way / 2;
  const std::array<Segment, 2> segments{Segment{0, sign * half, stored.repeat},
                                        Segment{0, sign * (way - half), stored.repeat}};
  end_at_ = board_.run(board_.context, axis,
                       {stored.position(), now, stored.counter1, segments.data(), segments.size()});
}

void UnitMachine::EndHomingAxis(BoardInstant now) {
  Flash& flash = *flash_;
  AxisFlash& stored = flash.axis[Index(homing_axis_)];
  board_.halt(board_.context, homing_axis_, now);
  board_.recount(board_.context, homing_axis_, stored.home_position);
  stored.set_position(stored.home_position);
  flash.lost_axes = static_cast<std::uint8_t>(flash.lost_axes & ~Bit(homing_axis_));
  board_.keep(board_.context);
}

// Homing that is cut short knows where an axis stands only if it knew before and cannot have met
// the stop.
void UnitMachine::StoreCutHoming(BoardInstant now) {
  Flash& flash = *flash_;
  AxisFlash& stored = flash.axis[Index(homing_axis_)];
  const bool up =
      stored.max_position - stored.home_position <= (stored.max_position - stored.min_position) / 2;
  const std::int32_t applied = board_.applied(board_.context, homing_axis_, now);
  std::uint8_t lost = lost_before_homing_;
  if (homing_axis_ == Axis::kTheta) lost = static_cast<std::uint8_t>(lost & ~Bit(Axis::kPhi));
  if (up ? applied > stored.home_position : applied < stored.home_position) {
    lost = static_cast<std::uint8_t>(lost | Bit(homing_axis_));
    const std::int32_t shown = NearestCongruent(stored.home_position, applied, stored.subdivision);
    board_.recount(board_.context, homing_axis_, shown);
    stored.set_position(shown);
  }
  flash.lost_axes = lost;
}

void UnitMachine::RaiseFault(const Trip& trip, BoardInstant now, TransmitQueue* out) {
  if (!powered_ || trip.code == FaultCode::kNone) return;
  const bool ran = state_ == UnitState::kMoving || state_ == UnitState::kHoming;
  if (ran) HaltAndStore(now);
  staged_ = {};
  begin_at_ = kNever;
  trip_ = trip;
  ++fault_count_;
  Enter(UnitState::kFault);
  SayDone(Outcome::kFault, 0, out);
}

bool UnitMachine::interrupted() const {
  const bool homing = state_ == UnitState::kHoming;
  return (homing ? lost_before_homing_ : flash_->lost_axes) != 0;
}

// ---- what is staged

StagedMove UnitMachine::Held() const {
  StagedMove held{staged_.begin.move, staged_.begin.mode, {}};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    for (std::size_t i = 0; i < limits::kSegmentsPerAxis; ++i)
      if ((staged_.received[axis] >> i & 1) != 0) held.path[axis].Append(staged_.segments[axis][i]);
  return held;
}

bool UnitMachine::PathInRange() const {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisFlash& stored = flash_->axis[axis];
    std::int64_t position = stored.position();
    for (std::size_t i = 0; i < staged_.begin.segments[axis]; ++i) {
      position += staged_.segments[axis][i].delta;
      if (position < stored.min_position || position > stored.max_position) return false;
    }
  }
  return true;
}

Answer UnitMachine::JudgeMove(MoveId move) const {
  const Flash& flash = *flash_;
  if (move.value != 0 && move == flash.last_begun) return Answer::kBegunBefore;
  if (state_ != UnitState::kRest && state_ != UnitState::kStaging && state_ != UnitState::kArmed)
    return Answer::kWrongState;
  if (staged_.begin.move.value == 0 || staged_.begin.move != move) return Answer::kWrongMove;
  if (flash.lost_axes != 0) return Answer::kInterrupted;
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    if (staged_.received[axis] != (1u << staged_.begin.segments[axis]) - 1)
      return Answer::kIncomplete;
  return PathInRange() ? Answer::kOk : Answer::kOutOfRange;
}

}  // namespace focalfleet::sim
