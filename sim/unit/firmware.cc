#include "sim/unit/firmware.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "protocol/base/check.h"

namespace focalfleet::sim {
namespace {

constexpr std::uint8_t kFirmwareMajor = 1;
constexpr std::uint8_t kFirmwareMinor = 0;
constexpr std::uint8_t kHardware = 1;
constexpr std::uint8_t kBothAxes = 3;
constexpr std::int32_t kCounter1Min = 50;
constexpr std::int32_t kCounter1Max = 20'000;
constexpr std::int32_t kSubdivisionMax = 1536;
constexpr std::int32_t kHostTimeoutMinMs = 100;
constexpr std::int32_t kHostTimeoutMaxMs = 3'600'000;

std::uint8_t Bit(Axis axis) { return static_cast<std::uint8_t>(1u << Index(axis)); }

std::int32_t FloorMod(std::int32_t a, std::int32_t n) { return (a % n + n) % n; }

// The place nearest to `value` that shows the same vector as `like`.
std::int32_t NearestCongruent(std::int32_t value, std::int32_t like, std::int32_t subdivision) {
  const std::int32_t below = value - FloorMod(value - like, subdivision);
  return value - below <= subdivision / 2 ? below : below + subdivision;
}

}  // namespace

void Outbox::Add(const CanFrame& frame) {
  FOCALFLEET_CHECK(count_ < frames_.size());
  frames_[count_++] = frame;
}

Firmware::Firmware(const Hardware& hardware) : hardware_(hardware) {}

// ---- power and time

void Firmware::PowerOn(HostInstant now) {
  if (powered_) return;
  *this = Firmware(hardware_);
  powered_ = true;
  restarted_ = true;
  powered_at_ = heard_at_ = now;
  Flash& flash = *hardware_.flash;
  if (flash.moving && flash.lost_axes == 0) flash.lost_axes = kBothAxes;
  for (const Axis axis : kAxes) {
    const AxisFlash& stored = flash.axis[Index(axis)];
    hardware_.axis[Index(axis)]->Energise({stored.position(), stored.subdivision});
  }
}

void Firmware::PowerOff(HostInstant now) {
  if (!powered_) return;
  for (AxisModel* axis : hardware_.axis) axis->Release(now);
  powered_ = false;
}

HostInstant Firmware::deadline() const {
  if (!powered_) return kNever;
  HostInstant due = std::min({begin_at_, end_at_, trip_at_});
  if (!host_lost_) {
    const double timeout_ns = hardware_.flash->host_timeout_ms * 1e6;
    due = std::min(due, heard_at_ + hardware_.clock.ToHost(timeout_ns));
  }
  return due;
}

void Firmware::OnTime(HostInstant now, Outbox* out) {
  if (!powered_) return;
  if (begin_at_ <= now) Begin(begin_at_);
  if (trip_at_ <= now && trip_at_ < end_at_) {
    const Trip trip{hardware_.faults->in_motion->code, hardware_.faults->in_motion->axis};
    hardware_.faults->in_motion.reset();
    RaiseFault(trip, now, out);
  }
  while (end_at_ <= now) End(end_at_, out);
  if (!host_lost_ && deadline() <= now) LoseHost();
}

void Firmware::LoseHost() {
  host_lost_ = true;
  // A motion that runs, and one whose start signal came, are finished first.
  if (state_ == UnitState::kRest || state_ == UnitState::kStaging ||
      (state_ == UnitState::kArmed && begin_at_ == kNever)) {
    staged_ = {};
    Enter(UnitState::kHostLost);
  }
}

UnitState Firmware::AtRest() const { return host_lost_ ? UnitState::kHostLost : UnitState::kRest; }

void Firmware::Enter(UnitState next) {
  FOCALFLEET_CHECK(Allowed(state_, next));
  state_ = next;
}

// ---- motion

void Firmware::Begin(HostInstant now) {
  Flash& flash = *hardware_.flash;
  FOCALFLEET_CHECK(state_ == UnitState::kArmed && staged_.begin.move != flash.last_begun);
  flash.moving = true;
  flash.last_begun = staged_.begin.move;
  ++flash.moves_begun;
  const StagedMove held = Held();
  staged_ = {};
  begin_at_ = kNever;
  began_at_ = end_at_ = now;
  for (const Axis axis : kAxes) {
    const AxisFlash& stored = flash.axis[Index(axis)];
    const FieldPath path({stored.position(), now, hardware_.clock, stored.counter1},
                         held.path[Index(axis)].segments());
    hardware_.axis[Index(axis)]->Run(path);
    end_at_ = std::max(end_at_, path.end());
  }
  if (hardware_.faults->in_motion) trip_at_ = now + hardware_.faults->in_motion->after;
  Enter(UnitState::kMoving);
}

void Firmware::HaltAndStore(HostInstant now) {
  Flash& flash = *hardware_.flash;
  for (const Axis axis : kAxes) {
    AxisModel& model = *hardware_.axis[Index(axis)];
    model.Halt(now);
    flash.axis[Index(axis)].set_position(model.Applied(now));
  }
  if (state_ == UnitState::kHoming) StoreCutHoming(now);
  flash.moving = flash.lost_axes != 0;
  end_at_ = trip_at_ = kNever;
}

void Firmware::End(HostInstant now, Outbox* out) {
  if (state_ == UnitState::kHoming) {
    EndHomingAxis(now);
    if (homing_axis_ == Axis::kPhi) return RunHoming(Axis::kTheta, now);
    hardware_.flash->moving = false;
    end_at_ = trip_at_ = kNever;
    Enter(AtRest());
    return SayDone(Outcome::kHomed, 0, out);
  }
  HaltAndStore(now);
  Enter(AtRest());
  SayDone(Outcome::kArrived, 0, out);
}

// Drives over the whole range and two turns more, so that the axis reaches its stop from anywhere,
// and ends on the vector that the stop shows.
void Firmware::RunHoming(Axis axis, HostInstant now) {
  homing_axis_ = axis;
  const AxisFlash& stored = hardware_.flash->axis[Index(axis)];
  const std::int32_t range = stored.max_position - stored.min_position;
  const bool up = stored.max_position - stored.home_position <= range / 2;
  const std::int32_t sign = up ? 1 : -1;
  std::int32_t way = range + range / 20 + 2 * stored.subdivision;
  way += FloorMod(sign * (stored.home_position - stored.position()) - way, stored.subdivision);
  // One segment carries 24 bits of way; two of them carry any range.
  const std::int32_t half = way / 2;
  const std::array<Segment, 2> segments{Segment{0, sign * half, stored.repeat},
                                        Segment{0, sign * (way - half), stored.repeat}};
  const FieldPath path({stored.position(), now, hardware_.clock, stored.counter1}, segments);
  hardware_.axis[Index(axis)]->Run(path);
  end_at_ = path.end();
}

void Firmware::EndHomingAxis(HostInstant now) {
  Flash& flash = *hardware_.flash;
  AxisFlash& stored = flash.axis[Index(homing_axis_)];
  AxisModel& model = *hardware_.axis[Index(homing_axis_)];
  model.Halt(now);
  model.Recount(stored.home_position);
  stored.set_position(stored.home_position);
  flash.lost_axes = static_cast<std::uint8_t>(flash.lost_axes & ~Bit(homing_axis_));
}

// Homing that is cut short knows where an axis stands only if it knew before and cannot have met
// the stop.
void Firmware::StoreCutHoming(HostInstant now) {
  Flash& flash = *hardware_.flash;
  AxisFlash& stored = flash.axis[Index(homing_axis_)];
  const bool up =
      stored.max_position - stored.home_position <= (stored.max_position - stored.min_position) / 2;
  const std::int32_t applied = hardware_.axis[Index(homing_axis_)]->Applied(now);
  std::uint8_t lost = lost_before_homing_;
  if (homing_axis_ == Axis::kTheta) lost = static_cast<std::uint8_t>(lost & ~Bit(Axis::kPhi));
  if (up ? applied > stored.home_position : applied < stored.home_position) {
    lost = static_cast<std::uint8_t>(lost | Bit(homing_axis_));
    const std::int32_t shown = NearestCongruent(stored.home_position, applied, stored.subdivision);
    hardware_.axis[Index(homing_axis_)]->Recount(shown);
    stored.set_position(shown);
  }
  flash.lost_axes = lost;
}

void Firmware::RaiseFault(const Trip& trip, HostInstant now, Outbox* out) {
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

bool Firmware::interrupted() const {
  const bool homing = state_ == UnitState::kHoming;
  return (homing ? lost_before_homing_ : hardware_.flash->lost_axes) != 0;
}

// ---- what is staged

StagedMove Firmware::Held() const {
  StagedMove held{staged_.begin.move, staged_.begin.mode, {}};
  for (std::size_t axis = 0; axis < kAxisCount; ++axis)
    for (std::size_t i = 0; i < limits::kSegmentsPerAxis; ++i)
      if ((staged_.received[axis] >> i & 1) != 0) held.path[axis].Append(staged_.segments[axis][i]);
  return held;
}

bool Firmware::PathInRange() const {
  for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
    const AxisFlash& stored = hardware_.flash->axis[axis];
    std::int64_t position = stored.position();
    for (std::size_t i = 0; i < staged_.begin.segments[axis]; ++i) {
      position += staged_.segments[axis][i].delta;
      if (position < stored.min_position || position > stored.max_position) return false;
    }
  }
  return true;
}

Answer Firmware::JudgeMove(MoveId move) const {
  const Flash& flash = *hardware_.flash;
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

// ---- frames

void Firmware::OnFrame(const CanFrame& frame, HostInstant now, Outbox* out) {
  if (!powered_) return;
  const auto decoded = DecodeHost(frame);
  if (!decoded) {
    ++malformed_;
    return;
  }
  const Address address = decoded->address;
  if (address.node != hardware_.node && address.node != kBroadcastNode) return;
  heard_at_ = now;
  const Context context{address, now, &frame, out};
  const bool resume = std::holds_alternative<StatusRequest>(decoded->message);
  if (!resume && !context.broadcast()) resume_id_ = 0;
  std::visit([&](const auto& message) { On(message, context); }, decoded->message);
}

void Firmware::Say(const UnitMessage& message, const Context& c) {
  c.out->Add(Encode(message, {hardware_.node, c.address.sequence}));
}

std::int32_t Firmware::Position(Axis axis, HostInstant now) const {
  return std::clamp(hardware_.axis[Index(axis)]->Applied(now), -limits::kPositionMax,
                    limits::kPositionMax);
}

void Firmware::SayDone(Outcome outcome, std::uint8_t sequence, Outbox* out) {
  if (sequence == 0 && hardware_.faults->mute_done) return;
  const Flash& flash = *hardware_.flash;
  const Done done{outcome, {flash.axis[0].position(), flash.axis[1].position()}, flash.last_begun};
  out->Add(Encode(UnitMessage{done}, {hardware_.node, sequence}));
}

void Firmware::On(const Stop&, const Context& c) {
  if (state_ == UnitState::kMoving || state_ == UnitState::kHoming) {
    HaltAndStore(c.now);
    Enter(AtRest());
  } else if (state_ == UnitState::kStaging || state_ == UnitState::kArmed) {
    Enter(AtRest());
  }
  staged_ = {};
  begin_at_ = kNever;
  const Flash& flash = *hardware_.flash;
  Say(Done{Outcome::kStopped,
           {flash.axis[0].position(), flash.axis[1].position()},
           flash.last_begun},
      c);
}

void Firmware::On(const Start& m, const Context& c) {
  // A start that comes again must not move the instant that the first one set.
  if (state_ != UnitState::kArmed || begin_at_ != kNever || host_lost_) return;
  if (m.move != staged_.begin.move) return;
  const double delay_ns = static_cast<double>(m.delay_ticks) * static_cast<double>(kTick.ns);
  begin_at_ = c.now + hardware_.clock.ToHost(delay_ns);
}

void Firmware::On(const Clock&, const Context&) {}

void Firmware::On(const ClockRequest&, const Context& c) {
  const double ticks =
      hardware_.clock.ToUnitNs(c.now - powered_at_) / static_cast<double>(kTick.ns);
  Say(ClockReply{static_cast<std::uint32_t>(static_cast<std::uint64_t>(ticks))}, c);
}

void Firmware::On(const StageBegin& m, const Context& c) {
  if (c.broadcast() || host_lost_) return;
  const bool takes = state_ == UnitState::kRest || state_ == UnitState::kStaging ||
                     (state_ == UnitState::kArmed && begin_at_ == kNever);
  const StageBegin& held = staged_.begin;
  if (!takes || (held.move == m.move && held.segments == m.segments && held.mode == m.mode)) return;
  staged_ = {};
  staged_.begin = m;
  Enter(UnitState::kStaging);
}

void Firmware::On(const StageSegment& m, const Context& c) {
  if (c.broadcast() || state_ != UnitState::kStaging) return;
  const std::size_t axis = Index(m.axis);
  if (m.index >= staged_.begin.segments[axis]) return;
  staged_.segments[axis][m.index] = m.segment;
  staged_.received[axis] = static_cast<std::uint16_t>(staged_.received[axis] | 1u << m.index);
}

void Firmware::On(const Confirm& m, const Context& c) {
  if (c.broadcast()) return;
  const StagedMove held = Held();
  const std::uint32_t mask = hardware_.faults->wrong_digest ? 0x00ff00ffu : 0u;
  Say(ConfirmReply{m.move,
                   Digest(held) ^ mask,
                   {held.path[0].size(), held.path[1].size()},
                   JudgeMove(m.move)},
      c);
}

void Firmware::On(const Arm& m, const Context& c) {
  if (c.broadcast()) return;
  // Its answer may have been lost while the start signal was not.
  const bool begun = m.move == hardware_.flash->last_begun;
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

void Firmware::On(const Home& m, const Context& c) {
  if (c.broadcast()) return;
  if (granted_home_.any && granted_home_.request == *c.frame)
    return Say(HomeReply{m.move, Answer::kOk}, c);
  Flash& flash = *hardware_.flash;
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
  began_at_ = c.now;
  if (hardware_.faults->in_motion) trip_at_ = c.now + hardware_.faults->in_motion->after;
  Enter(UnitState::kHoming);
  RunHoming(Axis::kPhi, c.now);
}

void Firmware::On(const ProgressRequest&, const Context& c) {
  Say(ProgressReply{state_,
                    {Position(Axis::kTheta, c.now), Position(Axis::kPhi, c.now)},
                    hardware_.flash->last_begun},
      c);
}

std::uint8_t Firmware::ProgressPercent(HostInstant now) const {
  if (state_ != UnitState::kMoving && state_ != UnitState::kHoming) return 0;
  const std::int64_t whole_ns = std::max<std::int64_t>(1, (end_at_ - began_at_).ns);
  const std::int64_t percent = (now - began_at_).ns * 100 / whole_ns;
  return static_cast<std::uint8_t>(std::clamp<std::int64_t>(percent, 0, 100));
}

void Firmware::On(const StatusRequest& m, const Context& c) {
  const bool again = m.resume && resume_id_ == c.frame->id;
  const bool restarted = again ? restarted_told_ : restarted_;
  resume_id_ = 0;
  if (m.resume) {
    resume_id_ = c.frame->id;
    restarted_told_ = restarted;
    restarted_ = false;
    host_lost_ = false;
    if (state_ == UnitState::kHostLost) Enter(UnitState::kRest);
  }
  const Flash& flash = *hardware_.flash;
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

void Firmware::On(const VectorRequest& m, const Context& c) {
  const AxisFlash& stored = hardware_.flash->axis[Index(m.axis)];
  Say(VectorReply{m.axis, stored.vector, stored.subdivision, stored.turns}, c);
}

void Firmware::On(const FaultRequest& m, const Context& c) {
  if (m.clear && !c.broadcast() && state_ == UnitState::kFault && !host_lost_) {
    trip_.code = FaultCode::kNone;
    Enter(UnitState::kRest);
  }
  Say(FaultReply{trip_.code, trip_.axis, hardware_.flash->last_begun, fault_count_}, c);
}

void Firmware::On(const IdentifyRequest&, const Context& c) {
  const SerialNumber serial = hardware_.faults->foreign_serial.value_or(hardware_.flash->serial);
  Say(IdentifyReply{serial, kProtocolVersion, kFirmwareMajor, kFirmwareMinor, kHardware}, c);
}

// ---- parameters

std::int32_t Firmware::Read(Axis axis, Parameter parameter, HostInstant now) const {
  const AxisFlash& stored = hardware_.flash->axis[Index(axis)];
  switch (parameter) {
    case Parameter::kCounter1:
      return stored.counter1;
    case Parameter::kRepeat:
      return stored.repeat;
    case Parameter::kSubdivision:
      return stored.subdivision;
    case Parameter::kMode:
      return static_cast<std::int32_t>(stored.mode);
    case Parameter::kPosition:
      return Position(axis, now);
    case Parameter::kMinPosition:
      return stored.min_position;
    case Parameter::kMaxPosition:
      return stored.max_position;
    case Parameter::kHomePosition:
      return stored.home_position;
    case Parameter::kHostTimeoutMs:
      return hardware_.flash->host_timeout_ms;
  }
  return 0;
}

void Firmware::On(const ParameterRead& m, const Context& c) {
  Say(ParameterReply{false, m.axis, m.parameter, Answer::kOk, Read(m.axis, m.parameter, c.now)}, c);
}

void Firmware::On(const ParameterWrite& m, const Context& c) {
  if (c.broadcast()) return;
  const Answer answer = state_ == UnitState::kRest ? Write(m, c.now) : Answer::kWrongState;
  Say(ParameterReply{true, m.axis, m.parameter, answer, Read(m.axis, m.parameter, c.now)}, c);
}

Answer Firmware::Write(const ParameterWrite& m, HostInstant) {
  AxisFlash& stored = hardware_.flash->axis[Index(m.axis)];
  const auto within = [&](std::int32_t low, std::int32_t high) {
    return m.value >= low && m.value <= high;
  };
  const bool place = within(-limits::kPositionMax, limits::kPositionMax);
  switch (m.parameter) {
    case Parameter::kCounter1:
      if (!within(kCounter1Min, kCounter1Max)) break;
      stored.counter1 = static_cast<std::uint16_t>(m.value);
      return Answer::kOk;
    case Parameter::kRepeat:
      if (!within(1, 255)) break;
      stored.repeat = static_cast<std::uint8_t>(m.value);
      return Answer::kOk;
    case Parameter::kSubdivision:
      return WriteSubdivision(m.axis, m.value);
    case Parameter::kMode:
      if (!within(0, 2)) break;
      stored.mode = static_cast<WaveMode>(m.value);
      return Answer::kOk;
    case Parameter::kPosition:
      return WritePosition(m.axis, m.value);
    case Parameter::kMinPosition:
      if (!place || m.value > stored.max_position) break;
      stored.min_position = m.value;
      return Answer::kOk;
    case Parameter::kMaxPosition:
      if (!place || m.value < stored.min_position) break;
      stored.max_position = m.value;
      return Answer::kOk;
    case Parameter::kHomePosition:
      if (!within(stored.min_position, stored.max_position)) break;
      stored.home_position = m.value;
      return Answer::kOk;
    case Parameter::kHostTimeoutMs:
      if (!within(kHostTimeoutMinMs, kHostTimeoutMaxMs)) break;
      hardware_.flash->host_timeout_ms = m.value;
      return Answer::kOk;
  }
  return Answer::kBadValue;
}

// The rotor agrees with the vector that is applied, so only whole turns can be wrong: the place
// taken is the one nearest to the value that shows this vector.
Answer Firmware::WritePosition(Axis axis, std::int32_t value) {
  Flash& flash = *hardware_.flash;
  AxisFlash& stored = flash.axis[Index(axis)];
  if (value < -limits::kPositionMax || value > limits::kPositionMax) return Answer::kBadValue;
  const std::int32_t place = NearestCongruent(value, stored.position(), stored.subdivision);
  if (std::abs(place) > limits::kPositionMax) return Answer::kBadValue;
  hardware_.axis[Index(axis)]->Recount(place);
  stored.set_position(place);
  flash.lost_axes = static_cast<std::uint8_t>(flash.lost_axes & ~Bit(axis));
  if (flash.lost_axes == 0) flash.moving = false;
  return Answer::kOk;
}

// All places keep their angle; the field goes to the nearest vector of the new division.
Answer Firmware::WriteSubdivision(Axis axis, std::int32_t value) {
  AxisFlash& stored = hardware_.flash->axis[Index(axis)];
  if (value < 6 || value > kSubdivisionMax || value % 6 != 0) return Answer::kBadValue;
  const auto rescaled = [&](std::int32_t old) {
    return std::llround(static_cast<double>(old) * value / stored.subdivision);
  };
  for (const std::int32_t old :
       {stored.position(), stored.min_position, stored.max_position, stored.home_position})
    if (std::abs(rescaled(old)) > limits::kPositionMax) return Answer::kBadValue;
  const auto position = static_cast<std::int32_t>(rescaled(stored.position()));
  stored.min_position = static_cast<std::int32_t>(rescaled(stored.min_position));
  stored.max_position = static_cast<std::int32_t>(rescaled(stored.max_position));
  stored.home_position = static_cast<std::int32_t>(rescaled(stored.home_position));
  stored.subdivision = static_cast<std::uint16_t>(value);
  stored.set_position(position);
  hardware_.axis[Index(axis)]->Energise({position, stored.subdivision});
  return Answer::kOk;
}

}  // namespace focalfleet::sim
