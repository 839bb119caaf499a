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
  restart_.unnoticed = true;
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
  BoardInstant due = std::min(motion_.begin_at, motion_.end_at);
  if (!host_lost_) {
    const DurationNs timeout = Milliseconds(flash_->host_timeout_ms);
    due = std::min(due, board_.after(board_.context, heard_at_, timeout));
  }
  return due;
}

void UnitMachine::OnTime(BoardInstant now, TransmitQueue* out) {
  if (!powered_) return;
  if (motion_.begin_at <= now) Begin(motion_.begin_at);
  while (motion_.end_at <= now) End(motion_.end_at, out);
  if (!host_lost_ && deadline() <= now) LoseHost();
}

void UnitMachine::OnSync(BoardInstant now) {
  if (!powered_ || motion_.begin_at == kNever) return;
  if (motion_.begin_at <= board_.after(board_.context, now, kSyncWindow)) Begin(now);
}

void UnitMachine::LoseHost() {
  host_lost_ = true;
  // A motion that runs is finished first, and so is one whose start signal came.
  if (state_ == UnitState::kRest || state_ == UnitState::kStaging ||
      (state_ == UnitState::kArmed && motion_.begin_at == kNever)) {
    staging_ = {};
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

void UnitMachine::SayDone(Outcome outcome, TransmitQueue* out) {
  const Flash& flash = *flash_;
  const Done done{outcome, {flash.axis[0].position(), flash.axis[1].position()}, flash.last_begun};
  out->Add(Encode(UnitMessage{done}, {node_, 0}));
}

// ---- motion

void UnitMachine::Begin(BoardInstant now) {
  Flash& flash = *flash_;
  FOCALFLEET_CHECK(state_ == UnitState::kArmed && staging_.move() != flash.last_begun);
  flash.moving = true;
  flash.last_begun = staging_.move();
  ++flash.moves_begun;
  board_.keep(board_.context);  // before the first step
  const StagedMove held = staging_.Held();
  staging_ = {};
  reading_.valid = false;
  motion_.begin_at = kNever;
  motion_.began_at = motion_.end_at = now;
  motion_.began_ticks = board_.ticks(board_.context, now);
  for (const Axis axis : kAxes) {
    const AxisFlash& stored = flash.axis[Index(axis)];
    const auto segments = held.path[Index(axis)].segments();
    const BoardInstant end =
        board_.run(board_.context, axis,
                   {stored.position(), now, stored.counter1, segments.data(), segments.size()});
    motion_.end_at = std::max(motion_.end_at, end);
  }
  Enter(UnitState::kMoving);
}

void UnitMachine::HaltAndStore(BoardInstant now) {
  Flash& flash = *flash_;
  for (const Axis axis : kAxes) {
    board_.halt(board_.context, axis, now);
    flash.axis[Index(axis)].set_position(board_.applied(board_.context, axis, now));
  }
  if (state_ == UnitState::kHoming) homing_.StoreCutShort(board_, flash_, now);
  flash.moving = flash.lost_axes != 0;
  board_.keep(board_.context);
  motion_.end_at = kNever;
}

void UnitMachine::End(BoardInstant now, TransmitQueue* out) {
  if (state_ == UnitState::kHoming) {
    homing_.EndAxis(board_, flash_, now);
    if (homing_.axis == Axis::kPhi) {
      motion_.end_at = homing_.Drive(board_, *flash_, Axis::kTheta, now);
      return;
    }
    flash_->moving = false;
    board_.keep(board_.context);
    motion_.end_at = kNever;
    Enter(AtRest());
    return SayDone(Outcome::kHomed, out);
  }
  HaltAndStore(now);
  Enter(AtRest());
  SayDone(Outcome::kArrived, out);
}

void UnitMachine::RaiseFault(const Trip& trip, BoardInstant now, TransmitQueue* out) {
  if (!powered_ || trip.code == FaultCode::kNone) return;
  const bool ran = state_ == UnitState::kMoving || state_ == UnitState::kHoming;
  if (ran) HaltAndStore(now);
  staging_ = {};
  motion_.begin_at = kNever;
  trip_ = trip;
  ++fault_count_;
  Enter(UnitState::kFault);
  SayDone(Outcome::kFault, out);
}

bool UnitMachine::interrupted() const {
  const bool homing = state_ == UnitState::kHoming;
  return (homing ? homing_.lost_before : flash_->lost_axes) != 0;
}

}  // namespace focalfleet::sim
