#include <algorithm>

#include "sim/world/unit/places.h"
#include "sim/world/unit/unit_machine.h"

namespace focalfleet::sim {
namespace {

constexpr std::uint8_t kFirmwareMajor = 1;
constexpr std::uint8_t kFirmwareMinor = 0;
constexpr std::uint8_t kHardware = 1;

}  // namespace

// ---- frames

void UnitMachine::OnFrame(const CanFrame& frame, BoardInstant now, TransmitQueue* out) {
  if (!powered_) return;
  const auto decoded = DecodeHost(frame);
  if (!decoded) {
    ++malformed_;
    return;
  }
  const Address address = decoded->address;
  if (address.node != node_ && address.node != kBroadcastNode) return;
  heard_at_ = now;
  const Context context{address, now, &frame, out};
  const bool resume = std::holds_alternative<StatusRequest>(decoded->message);
  if (!resume && !context.broadcast()) resume_id_ = 0;
  std::visit([&](const auto& message) { On(message, context); }, decoded->message);
}

void UnitMachine::OnGroup(const FdFrame& group, BoardInstant now, TransmitQueue* out) {
  if (!powered_) return;
  const auto entries = UnpackGroup(group);
  if (!entries) {
    ++malformed_;
    return;
  }
  for (std::size_t i = 0; i < entries->count; ++i)
    if ((entries->frame[i].id >> 11 & 255) == node_.value) OnFrame(entries->frame[i], now, out);
}

void UnitMachine::Say(const UnitMessage& message, const Context& c) {
  c.out->Add(Encode(message, {node_, c.address.sequence}));
}

std::int32_t UnitMachine::Position(Axis axis, BoardInstant now) const {
  return std::clamp(board_.applied(board_.context, axis, now), -limits::kPositionMax,
                    limits::kPositionMax);
}

void UnitMachine::SayDone(Outcome outcome, std::uint8_t sequence, TransmitQueue* out) {
  const Flash& flash = *flash_;
  const Done done{outcome, {flash.axis[0].position(), flash.axis[1].position()}, flash.last_begun};
  out->Add(Encode(UnitMessage{done}, {node_, sequence}));
}

void UnitMachine::On(const Stop&, const Context& c) {
  if (state_ == UnitState::kMoving || state_ == UnitState::kHoming) {
    HaltAndStore(c.now);
    Enter(AtRest());
  } else if (state_ == UnitState::kStaging || state_ == UnitState::kArmed) {
    Enter(AtRest());
  }
  staged_ = {};
  begin_at_ = kNever;
  const Flash& flash = *flash_;
  Say(Done{Outcome::kStopped,
           {flash.axis[0].position(), flash.axis[1].position()},
           flash.last_begun},
      c);
}

void UnitMachine::On(const Start& m, const Context& c) {
  // A start that comes again must not move the instant that the first one set.
  if (state_ != UnitState::kArmed || begin_at_ != kNever || host_lost_) return;
  if (m.move != staged_.begin.move) return;
  begin_at_ = board_.after(board_.context, c.now, kTick * m.delay_ticks);
}

void UnitMachine::On(const Clock&, const Context&) {}

void UnitMachine::On(const ClockRequest&, const Context& c) {
  Say(ClockReply{board_.ticks(board_.context, c.now), began_ticks_}, c);
}

void UnitMachine::On(const StageBegin& m, const Context& c) {
  if (c.broadcast() || host_lost_) return;
  const bool takes = state_ == UnitState::kRest || state_ == UnitState::kStaging ||
                     (state_ == UnitState::kArmed && begin_at_ == kNever);
  const StageBegin& held = staged_.begin;
  if (!takes || (held.move == m.move && held.segments == m.segments && held.mode == m.mode)) return;
  staged_ = {};
  staged_.begin = m;
  Enter(UnitState::kStaging);
}

void UnitMachine::On(const StageSegment& m, const Context& c) {
  if (c.broadcast() || state_ != UnitState::kStaging) return;
  const std::size_t axis = Index(m.axis);
  if (m.index >= staged_.begin.segments[axis]) return;
  staged_.segments[axis][m.index] = m.segment;
  staged_.received[axis] = static_cast<std::uint16_t>(staged_.received[axis] | 1u << m.index);
}

void UnitMachine::On(const Confirm& m, const Context& c) {
  if (c.broadcast()) return;
  const StagedMove held = Held();
  Say(
      ConfirmReply{
          m.move, Digest(held), {held.path[0].size(), held.path[1].size()}, JudgeMove(m.move)},
      c);
}

void UnitMachine::On(const Arm& m, const Context& c) {
  if (c.broadcast()) return;
  // Its answer may have been lost while the start signal was not.
  const bool begun = m.move == flash_->last_begun;
  if (begun && granted_arm_.any && granted_arm_.request == *c.frame)
    return Say(ArmReply{m.move, Answer::kOk}, c);
  Answer answer = JudgeMove(m.move);
  if (answer == Answer::kOk && m.digest != Digest(Held())) answer = Answer::kIncomplete;
  if (answer == Answer::kOk) {
    if (state_ != UnitState::kArmed) Enter(UnitState::kArmed);
    granted_arm_ = {true, *c.frame};
  }
  Say(ArmReply{m.move, answer}, c);
}

void UnitMachine::On(const Home& m, const Context& c) {
  if (c.broadcast()) return;
  if (granted_home_.any && granted_home_.request == *c.frame)
    return Say(HomeReply{m.move, Answer::kOk}, c);
  Flash& flash = *flash_;
  Answer answer = Answer::kOk;
  if (m.move.value == 0) {
    answer = Answer::kBadValue;
  } else if (m.move == flash.last_begun) {
    answer = Answer::kBegunBefore;
  } else if (state_ != UnitState::kRest && state_ != UnitState::kStaging) {
    answer = Answer::kWrongState;
  }
  Say(HomeReply{m.move, answer}, c);
  if (answer != Answer::kOk) return;
  granted_home_ = {true, *c.frame};
  staged_ = {};
  lost_before_homing_ = flash.lost_axes;
  flash.moving = true;
  flash.lost_axes = kBothAxes;
  flash.last_begun = m.move;
  ++flash.moves_begun;
  board_.keep(board_.context);
  sensed_ = false;
  began_at_ = c.now;
  began_ticks_ = board_.ticks(board_.context, c.now);
  Enter(UnitState::kHoming);
  RunHoming(Axis::kPhi, c.now);
}

void UnitMachine::On(const ProgressRequest&, const Context& c) {
  Say(
      ProgressReply{
          state_, {Position(Axis::kTheta, c.now), Position(Axis::kPhi, c.now)}, flash_->last_begun},
      c);
}

std::uint8_t UnitMachine::ProgressPercent(BoardInstant now) const {
  if (state_ != UnitState::kMoving && state_ != UnitState::kHoming) return 0;
  const std::int64_t whole_ns = std::max<std::int64_t>(1, (end_at_ - began_at_).ns);
  const std::int64_t percent = (now - began_at_).ns * 100 / whole_ns;
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(percent, 0, 100));
}

void UnitMachine::On(const StatusRequest& m, const Context& c) {
  const bool again = m.resume && resume_id_ == c.frame->id;
  const bool restarted = again ? restarted_reported_ : restarted_;
  resume_id_ = 0;
  if (m.resume) {
    resume_id_ = c.frame->id;
    restarted_reported_ = restarted;
    restarted_ = false;
    host_lost_ = false;
    if (state_ == UnitState::kHostLost) Enter(UnitState::kRest);
  }
  const Flash& flash = *flash_;
  Say(StatusReply{.state = state_,
                  .fault = trip_.code,
                  .interrupted = interrupted(),
                  .host_lost = host_lost_,
                  .restarted = restarted,
                  .progress_percent = ProgressPercent(c.now),
                  .move = flash.last_begun,
                  .moves_begun = static_cast<std::uint16_t>(flash.moves_begun)},
      c);
}

void UnitMachine::On(const VectorRequest& m, const Context& c) {
  const AxisFlash& stored = flash_->axis[Index(m.axis)];
  Say(VectorReply{m.axis, stored.vector, stored.subdivision, stored.turns}, c);
}

void UnitMachine::On(const FaultRequest& m, const Context& c) {
  if (m.clear && !c.broadcast() && state_ == UnitState::kFault && !host_lost_) {
    trip_.code = FaultCode::kNone;
    Enter(UnitState::kRest);
  }
  Say(FaultReply{trip_.code, trip_.axis, flash_->last_begun, fault_count_}, c);
}

void UnitMachine::On(const IdentifyRequest&, const Context& c) {
  const std::uint8_t version = board_.sensors > 0 ? kProtocolVersionWithSensors : kProtocolVersion;
  Say(IdentifyReply{flash_->serial, version, kFirmwareMajor, kFirmwareMinor, kHardware}, c);
}

void UnitMachine::On(const SensorsRequest& m, const Context& c) {
  if (board_.sensors == 0) {  // version 1 has no such frame
    ++malformed_;
    return;
  }
  if (m.part == 0 || !sensed_) {
    counts_.fill(kNoCount);
    board_.sense(board_.context, c.now, counts_.data());
    sensed_ = true;
  }
  SensorsReply reply{m.part, {}};
  for (std::size_t k = 0; k < kSensorsPerPart; ++k)
    reply.counts[k] = counts_[m.part * kSensorsPerPart + k];
  Say(reply, c);
}

}  // namespace focalfleet::sim
