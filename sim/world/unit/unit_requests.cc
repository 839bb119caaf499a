#include <algorithm>
#include <variant>

#include "sim/world/unit/places.h"
#include "sim/world/unit/unit_machine.h"
#include "sim/world/unit/unit_parameters.h"

namespace focalfleet::sim {
namespace {

constexpr std::uint8_t kFirmwareMajor = 1;
constexpr std::uint8_t kFirmwareMinor = 0;
constexpr std::uint8_t kHardware = 1;

}  // namespace

// The handler of a request to the unit, with a function for each kind.
class UnitMachine::RequestHandler {
 public:
  /// Lifetime: all arguments outlive the handler.
  RequestHandler(UnitMachine* unit, const Address& address, const CanFrame& frame, BoardInstant now,
                 TransmitQueue* out)
      : unit_(*unit), address_(address), frame_(&frame), now_(now), out_(out) {}

  void On(const Stop&);
  void On(const Start& m);
  void On(const Clock&);
  void On(const ClockRequest&);
  void On(const StageBegin& m);
  void On(const StageSegment& m);
  void On(const Confirm& m);
  void On(const Arm& m);
  void On(const Home& m);
  void On(const ProgressRequest&);
  void On(const StatusRequest& m);
  void On(const VectorRequest& m);
  void On(const FaultRequest& m);
  void On(const IdentifyRequest&);
  void On(const SensorsRequest& m);
  void On(const ParameterRead& m);
  void On(const ParameterWrite& m);

 private:
  [[nodiscard]] bool broadcast() const { return address_.node == kBroadcastNode; }
  void Say(const UnitMessage& message) {
    out_->Add(Encode(message, {unit_.node_, address_.sequence}));
  }
  [[nodiscard]] Answer JudgeMove(MoveId move) const;
  [[nodiscard]] std::uint8_t ProgressPercent() const;

  UnitMachine& unit_;
  const Address address_;
  const CanFrame* frame_;
  BoardInstant now_;
  TransmitQueue* out_;
};

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
  const bool resume = std::holds_alternative<StatusRequest>(decoded->message);
  if (!resume && address.node != kBroadcastNode) restart_.resume_id = 0;
  RequestHandler handler(this, address, frame, now, out);
  std::visit([&](const auto& message) { handler.On(message); }, decoded->message);
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

// ---- requests

void UnitMachine::RequestHandler::On(const Stop&) {
  if (unit_.state_ == UnitState::kMoving || unit_.state_ == UnitState::kHoming) {
    unit_.HaltAndStore(now_);
    unit_.Enter(unit_.AtRest());
  } else if (unit_.state_ == UnitState::kStaging || unit_.state_ == UnitState::kArmed) {
    unit_.Enter(unit_.AtRest());
  }
  unit_.staging_ = {};
  unit_.motion_.begin_at = kNever;
  const Flash& flash = *unit_.flash_;
  Say(Done{
      Outcome::kStopped, {flash.axis[0].position(), flash.axis[1].position()}, flash.last_begun});
}

void UnitMachine::RequestHandler::On(const Start& m) {
  // A start that comes again must not move the instant that the first one set.
  if (unit_.state_ != UnitState::kArmed || unit_.motion_.begin_at != kNever || unit_.host_lost_)
    return;
  if (m.move != unit_.staging_.move()) return;
  unit_.motion_.begin_at = unit_.board_.after(unit_.board_.context, now_, kTick * m.delay_ticks);
}

void UnitMachine::RequestHandler::On(const Clock&) {}

void UnitMachine::RequestHandler::On(const ClockRequest&) {
  Say(ClockReply{unit_.board_.ticks(unit_.board_.context, now_), unit_.motion_.began_ticks});
}

void UnitMachine::RequestHandler::On(const StageBegin& m) {
  if (broadcast() || unit_.host_lost_) return;
  const bool takes = unit_.state_ == UnitState::kRest || unit_.state_ == UnitState::kStaging ||
                     (unit_.state_ == UnitState::kArmed && unit_.motion_.begin_at == kNever);
  if (!takes || unit_.staging_.BeganWith(m)) return;
  unit_.staging_ = Staging(m);
  unit_.Enter(UnitState::kStaging);
}

void UnitMachine::RequestHandler::On(const StageSegment& m) {
  if (broadcast() || unit_.state_ != UnitState::kStaging) return;
  unit_.staging_.Take(m);
}

Answer UnitMachine::RequestHandler::JudgeMove(MoveId move) const {
  const Flash& flash = *unit_.flash_;
  if (move.value != 0 && move == flash.last_begun) return Answer::kBegunBefore;
  if (unit_.state_ != UnitState::kRest && unit_.state_ != UnitState::kStaging &&
      unit_.state_ != UnitState::kArmed)
    return Answer::kWrongState;
  if (unit_.staging_.move().value == 0 || unit_.staging_.move() != move) return Answer::kWrongMove;
  if (flash.lost_axes != 0) return Answer::kInterrupted;
  if (!unit_.staging_.complete()) return Answer::kIncomplete;
  return unit_.staging_.PathInRange(flash) ? Answer::kOk : Answer::kOutOfRange;
}

void UnitMachine::RequestHandler::On(const Confirm& m) {
  if (broadcast()) return;
  const StagedMove held = unit_.staging_.Held();
  Say(ConfirmReply{
      m.move, Digest(held), {held.path[0].size(), held.path[1].size()}, JudgeMove(m.move)});
}

void UnitMachine::RequestHandler::On(const Arm& m) {
  if (broadcast()) return;
  // The answer may have been lost while the start signal was not.
  const bool begun = m.move == unit_.flash_->last_begun;
  if (begun && unit_.granted_arm_.any && unit_.granted_arm_.request == *frame_)
    return Say(ArmReply{m.move, Answer::kOk});
  Answer answer = JudgeMove(m.move);
  if (answer == Answer::kOk && m.digest != Digest(unit_.staging_.Held()))
    answer = Answer::kIncomplete;
  if (answer == Answer::kOk) {
    if (unit_.state_ != UnitState::kArmed) unit_.Enter(UnitState::kArmed);
    unit_.granted_arm_ = {true, *frame_};
  }
  Say(ArmReply{m.move, answer});
}

void UnitMachine::RequestHandler::On(const Home& m) {
  if (broadcast()) return;
  if (unit_.granted_home_.any && unit_.granted_home_.request == *frame_)
    return Say(HomeReply{m.move, Answer::kOk});
  Flash& flash = *unit_.flash_;
  Answer answer = Answer::kOk;
  if (m.move.value == 0) {
    answer = Answer::kBadValue;
  } else if (m.move == flash.last_begun) {
    answer = Answer::kBegunBefore;
  } else if (unit_.state_ != UnitState::kRest && unit_.state_ != UnitState::kStaging) {
    answer = Answer::kWrongState;
  }
  Say(HomeReply{m.move, answer});
  if (answer != Answer::kOk) return;
  unit_.granted_home_ = {true, *frame_};
  unit_.staging_ = {};
  unit_.homing_.lost_before = flash.lost_axes;
  flash.moving = true;
  flash.lost_axes = kBothAxes;
  flash.last_begun = m.move;
  ++flash.moves_begun;
  unit_.board_.keep(unit_.board_.context);
  unit_.reading_.valid = false;
  unit_.motion_.began_at = now_;
  unit_.motion_.began_ticks = unit_.board_.ticks(unit_.board_.context, now_);
  unit_.Enter(UnitState::kHoming);
  unit_.motion_.end_at = unit_.homing_.Drive(unit_.board_, *unit_.flash_, Axis::kPhi, now_);
}

void UnitMachine::RequestHandler::On(const ProgressRequest&) {
  Say(ProgressReply{unit_.state_,
                    {AppliedPosition(unit_.board_, Axis::kTheta, now_),
                     AppliedPosition(unit_.board_, Axis::kPhi, now_)},
                    unit_.flash_->last_begun});
}

std::uint8_t UnitMachine::RequestHandler::ProgressPercent() const {
  if (unit_.state_ != UnitState::kMoving && unit_.state_ != UnitState::kHoming) return 0;
  const std::int64_t whole_ns =
      std::max<std::int64_t>(1, (unit_.motion_.end_at - unit_.motion_.began_at).ns);
  const std::int64_t percent = (now_ - unit_.motion_.began_at).ns * 100 / whole_ns;
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(percent, 0, 100));
}

void UnitMachine::RequestHandler::On(const StatusRequest& m) {
  const bool again = m.resume && unit_.restart_.resume_id == frame_->id;
  const bool restarted = again ? unit_.restart_.reported : unit_.restart_.unnoticed;
  unit_.restart_.resume_id = 0;
  if (m.resume) {
    unit_.restart_.resume_id = frame_->id;
    unit_.restart_.reported = restarted;
    unit_.restart_.unnoticed = false;
    unit_.host_lost_ = false;
    if (unit_.state_ == UnitState::kHostLost) unit_.Enter(UnitState::kRest);
  }
  const Flash& flash = *unit_.flash_;
  Say(StatusReply{.state = unit_.state_,
                  .fault = unit_.trip_.code,
                  .interrupted = unit_.interrupted(),
                  .host_lost = unit_.host_lost_,
                  .restarted = restarted,
                  .progress_percent = ProgressPercent(),
                  .move = flash.last_begun,
                  .moves_begun = static_cast<std::uint16_t>(flash.moves_begun)});
}

void UnitMachine::RequestHandler::On(const VectorRequest& m) {
  const AxisFlash& stored = unit_.flash_->axis[Index(m.axis)];
  Say(VectorReply{m.axis, stored.vector, stored.subdivision, stored.turns});
}

void UnitMachine::RequestHandler::On(const FaultRequest& m) {
  if (m.clear && !broadcast() && unit_.state_ == UnitState::kFault && !unit_.host_lost_) {
    unit_.trip_.code = FaultCode::kNone;
    unit_.Enter(UnitState::kRest);
  }
  Say(FaultReply{unit_.trip_.code, unit_.trip_.axis, unit_.flash_->last_begun, unit_.fault_count_});
}

void UnitMachine::RequestHandler::On(const IdentifyRequest&) {
  const std::uint8_t version =
      unit_.board_.sensors > 0 ? kProtocolVersionWithSensors : kProtocolVersion;
  Say(IdentifyReply{unit_.flash_->serial, version, kFirmwareMajor, kFirmwareMinor, kHardware});
}

void UnitMachine::RequestHandler::On(const SensorsRequest& m) {
  if (unit_.board_.sensors == 0) {  // version 1 has no such frame
    ++unit_.malformed_;
    return;
  }
  if (m.part == 0 || !unit_.reading_.valid) {
    unit_.reading_.counts.fill(kNoCount);
    unit_.board_.sense(unit_.board_.context, now_, unit_.reading_.counts.data());
    unit_.reading_.valid = true;
  }
  SensorsReply reply{m.part, {}};
  for (std::size_t k = 0; k < kSensorsPerPart; ++k)
    reply.counts[k] = unit_.reading_.counts[m.part * kSensorsPerPart + k];
  Say(reply);
}

void UnitMachine::RequestHandler::On(const ParameterRead& m) {
  Say(ParameterReply{false, m.axis, m.parameter, Answer::kOk,
                     ReadParameter(unit_.board_, *unit_.flash_, m, now_)});
}

void UnitMachine::RequestHandler::On(const ParameterWrite& m) {
  if (broadcast()) return;
  const Answer answer = unit_.state_ == UnitState::kRest
                            ? WriteParameter(unit_.board_, unit_.flash_, m)
                            : Answer::kWrongState;
  if (answer == Answer::kOk) unit_.board_.keep(unit_.board_.context);
  Say(ParameterReply{true, m.axis, m.parameter, answer,
                     ReadParameter(unit_.board_, *unit_.flash_, {m.axis, m.parameter}, now_)});
}

}  // namespace focalfleet::sim
