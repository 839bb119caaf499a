#include "protocol/wire/codec.h"

#include <cstring>

#include "protocol/base/limits.h"
#include "protocol/wire/staged_move.h"

namespace focalfleet {
namespace {

// ---- bytes

class Writer {
 public:
  Writer(Function function, bool from_unit, Address address, std::uint8_t detail = 0) {
    frame_.id = Pack({function, from_unit, address, detail});
  }
  Writer& Unsigned(std::uint64_t value, int bytes) {
    for (int i = 0; i < bytes; ++i)
      frame_.data[frame_.length++] = static_cast<std::uint8_t>(value >> (8 * i));
    return *this;
  }
  Writer& Signed(std::int64_t value, int bytes) {
    return Unsigned(static_cast<std::uint64_t>(value), bytes);
  }
  [[nodiscard]] CanFrame frame() const { return frame_; }

 private:
  CanFrame frame_;
};

std::uint32_t Unsigned(const CanFrame& frame, std::size_t at, std::size_t bytes) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i)
    value |= static_cast<std::uint32_t>(frame.data[at + i]) << (8 * i);
  return value;
}
std::uint16_t U16(const CanFrame& frame, std::size_t at) {
  return static_cast<std::uint16_t>(Unsigned(frame, at, 2));
}
std::int32_t S24(const CanFrame& frame, std::size_t at) {
  return static_cast<std::int32_t>(Unsigned(frame, at, 3) << 8) >> 8;
}
std::int32_t S32(const CanFrame& frame, std::size_t at) {
  return static_cast<std::int32_t>(Unsigned(frame, at, 4));
}

constexpr std::uint8_t kResumeBit = 1;
constexpr std::uint8_t kClearBit = 1;
constexpr std::uint8_t kRequestBit = 1;  // on kClock: a request for the unit's ticks
constexpr std::uint8_t kInterruptedFlag = 1;
constexpr std::uint8_t kHostLostFlag = 2;
constexpr std::uint8_t kRestartedFlag = 4;
constexpr std::uint8_t kFlags = kInterruptedFlag | kHostLostFlag | kRestartedFlag;

std::uint8_t Detail(Axis axis) { return static_cast<std::uint8_t>(axis); }

struct HostEncoder {
  Address to;
  [[nodiscard]] Writer Begin(Function f, std::uint8_t detail = 0) const {
    return {f, false, to, detail};
  }

  CanFrame operator()(const Stop&) const { return Begin(Function::kStop).frame(); }
  CanFrame operator()(const Start& m) const {
    return Begin(Function::kStart).Unsigned(m.move.value, 2).Unsigned(m.delay_ticks, 3).frame();
  }
  CanFrame operator()(const Clock& m) const {
    return Begin(Function::kClock).Unsigned(m.host_us, 6).frame();
  }
  CanFrame operator()(const ClockRequest&) const {
    return Begin(Function::kClock, kRequestBit).frame();
  }
  CanFrame operator()(const Arm& m) const {
    return Begin(Function::kArm).Unsigned(m.move.value, 2).Unsigned(m.digest, 4).frame();
  }
  CanFrame operator()(const Confirm& m) const {
    return Begin(Function::kConfirm).Unsigned(m.move.value, 2).frame();
  }
  CanFrame operator()(const StageBegin& m) const {
    return Begin(Function::kStageBegin)
        .Unsigned(m.move.value, 2)
        .Unsigned(m.segments[0], 1)
        .Unsigned(m.segments[1], 1)
        .Unsigned(static_cast<std::uint8_t>(m.mode), 1)
        .frame();
  }
  CanFrame operator()(const StageSegment& m) const {
    return Begin(Function::kStageSegment, Detail(m.axis))
        .Unsigned(m.index, 1)
        .Unsigned(m.segment.start_ticks, 3)
        .Signed(m.segment.delta, 3)
        .Unsigned(m.segment.repeat, 1)
        .frame();
  }
  CanFrame operator()(const Home& m) const {
    return Begin(Function::kHome).Unsigned(m.move.value, 2).frame();
  }
  CanFrame operator()(const ProgressRequest&) const { return Begin(Function::kProgress).frame(); }
  CanFrame operator()(const StatusRequest& m) const {
    return Begin(Function::kStatus, m.resume ? kResumeBit : 0).frame();
  }
  CanFrame operator()(const VectorRequest& m) const {
    return Begin(Function::kVector, Detail(m.axis)).frame();
  }
  CanFrame operator()(const FaultRequest& m) const {
    return Begin(Function::kFault, m.clear ? kClearBit : 0).frame();
  }
  CanFrame operator()(const IdentifyRequest&) const { return Begin(Function::kIdentify).frame(); }
  CanFrame operator()(const ParameterRead& m) const {
    return Begin(Function::kParameterRead, Detail(m.axis))
        .Unsigned(static_cast<std::uint8_t>(m.parameter), 1)
        .frame();
  }
  CanFrame operator()(const ParameterWrite& m) const {
    return Begin(Function::kParameterWrite, Detail(m.axis))
        .Unsigned(static_cast<std::uint8_t>(m.parameter), 1)
        .Signed(m.value, 4)
        .frame();
  }
};

struct UnitEncoder {
  Address from;
  [[nodiscard]] Writer Begin(Function f, std::uint8_t detail = 0) const {
    return {f, true, from, detail};
  }

  CanFrame operator()(const Done& m) const {
    return Begin(Function::kDone, static_cast<std::uint8_t>(m.outcome))
        .Signed(m.position[0], 3)
        .Signed(m.position[1], 3)
        .Unsigned(m.move.value, 2)
        .frame();
  }
  CanFrame operator()(const ClockReply& m) const {
    return Begin(Function::kClock).Unsigned(m.ticks, 4).frame();
  }
  CanFrame operator()(const ArmReply& m) const {
    return Begin(Function::kArm)
        .Unsigned(m.move.value, 2)
        .Unsigned(static_cast<std::uint8_t>(m.answer), 1)
        .frame();
  }
  CanFrame operator()(const ConfirmReply& m) const {
    return Begin(Function::kConfirm)
        .Unsigned(m.move.value, 2)
        .Unsigned(m.digest, 4)
        .Unsigned(static_cast<std::uint32_t>(m.segments[0] | m.segments[1] << 4), 1)
        .Unsigned(static_cast<std::uint8_t>(m.answer), 1)
        .frame();
  }
  CanFrame operator()(const HomeReply& m) const {
    return Begin(Function::kHome)
        .Unsigned(m.move.value, 2)
        .Unsigned(static_cast<std::uint8_t>(m.answer), 1)
        .frame();
  }
  CanFrame operator()(const ProgressReply& m) const {
    return Begin(Function::kProgress, static_cast<std::uint8_t>(m.state))
        .Signed(m.position[0], 3)
        .Signed(m.position[1], 3)
        .Unsigned(m.move.value, 2)
        .frame();
  }
  CanFrame operator()(const StatusReply& m) const {
    const auto flags = (m.interrupted ? kInterruptedFlag : 0u) |
                       (m.host_lost ? kHostLostFlag : 0u) | (m.restarted ? kRestartedFlag : 0u);
    return Begin(Function::kStatus)
        .Unsigned(static_cast<std::uint8_t>(m.state), 1)
        .Unsigned(static_cast<std::uint8_t>(m.fault), 1)
        .Unsigned(flags, 1)
        .Unsigned(m.progress_percent, 1)
        .Unsigned(m.move.value, 2)
        .Unsigned(m.moves_begun, 2)
        .frame();
  }
  CanFrame operator()(const VectorReply& m) const {
    return Begin(Function::kVector, Detail(m.axis))
        .Unsigned(m.vector, 2)
        .Unsigned(m.subdivision, 2)
        .Signed(m.turns, 4)
        .frame();
  }
  CanFrame operator()(const FaultReply& m) const {
    return Begin(Function::kFault)
        .Unsigned(static_cast<std::uint8_t>(m.code), 1)
        .Unsigned(static_cast<std::uint8_t>(m.axis), 1)
        .Unsigned(m.move.value, 2)
        .Unsigned(m.count, 2)
        .frame();
  }
  CanFrame operator()(const IdentifyReply& m) const {
    return Begin(Function::kIdentify)
        .Unsigned(m.serial.value, 4)
        .Unsigned(m.protocol_version, 1)
        .Unsigned(m.firmware_major, 1)
        .Unsigned(m.firmware_minor, 1)
        .Unsigned(m.hardware, 1)
        .frame();
  }
  CanFrame operator()(const ParameterReply& m) const {
    return Begin(m.written ? Function::kParameterWrite : Function::kParameterRead, Detail(m.axis))
        .Unsigned(static_cast<std::uint8_t>(m.parameter), 1)
        .Unsigned(static_cast<std::uint8_t>(m.answer), 1)
        .Signed(m.value, 4)
        .frame();
  }
};

// ---- decoding

struct Opened {
  Function function;
  Address address;
  std::uint8_t detail;
};

tl::expected<Opened, Malformed> Open(const CanFrame& frame, bool from_unit) {
  if (frame.id > kCanIdMax) return tl::unexpected(Malformed::kIdentifier);
  if (frame.length > 8) return tl::unexpected(Malformed::kLength);
  const std::uint32_t number = frame.id >> 20 & 63;
  if (number >= kFunctionCount || kFunctions[number].priority != frame.id >> 26)
    return tl::unexpected(Malformed::kFunction);
  if ((frame.id >> 19 & 1) != (from_unit ? 1u : 0u)) return tl::unexpected(Malformed::kDirection);
  const NodeId node{static_cast<std::uint8_t>(frame.id >> 11)};
  if (from_unit && node == kBroadcastNode) return tl::unexpected(Malformed::kNode);
  return Opened{static_cast<Function>(number),
                {node, static_cast<std::uint8_t>(frame.id >> 3)},
                static_cast<std::uint8_t>(frame.id & 7)};
}

template <class Enumeration>
bool Valid(std::uint32_t value, std::uint8_t count, Enumeration* out) {
  if (value >= count) return false;
  *out = static_cast<Enumeration>(value);
  return true;
}

// A decoder of one message: checks the length and the detail bits, then hands over.
struct Expect {
  std::uint8_t length;
  std::uint8_t detail_max = 0;
};
tl::expected<void, Malformed> Check(const CanFrame& frame, const Opened& open, Expect expect) {
  if (frame.length != expect.length) return tl::unexpected(Malformed::kLength);
  if (open.detail > expect.detail_max) return tl::unexpected(Malformed::kReserved);
  return {};
}

template <class M>
using Decoded = tl::expected<M, Malformed>;

Decoded<HostMessage> DecodeStage(const CanFrame& frame, const Opened& open) {
  if (open.function == Function::kStageBegin) {
    if (auto ok = Check(frame, open, {5}); !ok) return tl::unexpected(ok.error());
    StageBegin m{.move = {U16(frame, 0)}, .segments = {frame.data[2], frame.data[3]}};
    if (m.segments[0] > limits::kSegmentsPerAxis || m.segments[1] > limits::kSegmentsPerAxis ||
        m.move.value == 0 || !Valid(frame.data[4], 3, &m.mode))
      return tl::unexpected(Malformed::kValue);
    return m;
  }
  if (auto ok = Check(frame, open, {8, 1}); !ok) return tl::unexpected(ok.error());
  const StageSegment m{.axis = static_cast<Axis>(open.detail),
                       .index = frame.data[0],
                       .segment = {Unsigned(frame, 1, 3), S24(frame, 4), frame.data[7]}};
  if (m.index >= limits::kSegmentsPerAxis || m.segment.repeat == 0)
    return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<HostMessage> DecodeHostBody(const CanFrame& frame, const Opened& open) {
  const auto check = [&](std::uint8_t length, std::uint8_t detail_max = 0) {
    return Check(frame, open, {length, detail_max});
  };
  switch (open.function) {
    case Function::kStop:
      return check(0).map([] { return HostMessage{Stop{}}; });
    case Function::kStart:
      return check(5).map([&] {
        return HostMessage{Start{{U16(frame, 0)}, Unsigned(frame, 2, 3)}};
      });
    case Function::kClock:
      if (open.detail == kRequestBit)
        return check(0, kRequestBit).map([] { return HostMessage{ClockRequest{}}; });
      return check(6).map([&] {
        const std::uint64_t high = Unsigned(frame, 4, 2);
        return HostMessage{Clock{high << 32 | Unsigned(frame, 0, 4)}};
      });
    case Function::kArm:
      return check(6).map([&] { return HostMessage{Arm{{U16(frame, 0)}, Unsigned(frame, 2, 4)}}; });
    case Function::kConfirm:
      return check(2).map([&] { return HostMessage{Confirm{{U16(frame, 0)}}}; });
    case Function::kStageBegin:
    case Function::kStageSegment:
      return DecodeStage(frame, open);
    case Function::kHome:
      return check(2).map([&] { return HostMessage{Home{{U16(frame, 0)}}}; });
    case Function::kProgress:
      return check(0).map([] { return HostMessage{ProgressRequest{}}; });
    case Function::kStatus:
      return check(0, kResumeBit).map([&] { return HostMessage{StatusRequest{open.detail != 0}}; });
    case Function::kVector:
      return check(0, 1).map(
          [&] { return HostMessage{VectorRequest{static_cast<Axis>(open.detail)}}; });
    case Function::kFault:
      return check(0, kClearBit).map([&] { return HostMessage{FaultRequest{open.detail != 0}}; });
    case Function::kIdentify:
      return check(0).map([] { return HostMessage{IdentifyRequest{}}; });
    case Function::kParameterRead:
    case Function::kParameterWrite: {
      const bool write = open.function == Function::kParameterWrite;
      if (auto ok = check(write ? 5 : 1, 1); !ok) return tl::unexpected(ok.error());
      Parameter parameter{};
      if (!Valid(frame.data[0], kParameterCount, &parameter))
        return tl::unexpected(Malformed::kValue);
      const auto axis = static_cast<Axis>(open.detail);
      if (write) return ParameterWrite{axis, parameter, S32(frame, 1)};
      return ParameterRead{axis, parameter};
    }
    case Function::kDone:
      break;
  }
  return tl::unexpected(Malformed::kDirection);
}

Decoded<UnitMessage> DecodeStatus(const CanFrame& frame) {
  StatusReply m{.interrupted = (frame.data[2] & kInterruptedFlag) != 0,
                .host_lost = (frame.data[2] & kHostLostFlag) != 0,
                .restarted = (frame.data[2] & kRestartedFlag) != 0,
                .progress_percent = frame.data[3],
                .move = {U16(frame, 4)},
                .moves_begun = U16(frame, 6)};
  if ((frame.data[2] & ~kFlags) != 0) return tl::unexpected(Malformed::kReserved);
  if (!Valid(frame.data[0], kUnitStateCount, &m.state) ||
      !Valid(frame.data[1], kFaultCodeCount, &m.fault) || m.progress_percent > 100)
    return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<UnitMessage> DecodeConfirm(const CanFrame& frame) {
  ConfirmReply m{.move = {U16(frame, 0)},
                 .digest = Unsigned(frame, 2, 4),
                 .segments = {static_cast<std::uint8_t>(frame.data[6] & 15),
                              static_cast<std::uint8_t>(frame.data[6] >> 4)}};
  if (!Valid(frame.data[7], kAnswerCount, &m.answer)) return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<UnitMessage> DecodeVector(const CanFrame& frame, Axis axis) {
  const VectorReply m{
      .axis = axis, .vector = U16(frame, 0), .subdivision = U16(frame, 2), .turns = S32(frame, 4)};
  const std::int64_t position = std::int64_t{m.turns} * m.subdivision + m.vector;
  if (m.subdivision == 0 || m.vector >= m.subdivision || position > limits::kPositionMax ||
      position < -limits::kPositionMax)
    return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<UnitMessage> DecodeFault(const CanFrame& frame) {
  FaultReply m{.move = {U16(frame, 2)}, .count = U16(frame, 4)};
  if (!Valid(frame.data[0], kFaultCodeCount, &m.code) || !Valid(frame.data[1], 2, &m.axis))
    return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<UnitMessage> DecodeParameter(const CanFrame& frame, const Opened& open) {
  ParameterReply m{.written = open.function == Function::kParameterWrite,
                   .axis = static_cast<Axis>(open.detail),
                   .value = S32(frame, 2)};
  if (!Valid(frame.data[0], kParameterCount, &m.parameter) ||
      !Valid(frame.data[1], kAnswerCount, &m.answer))
    return tl::unexpected(Malformed::kValue);
  return m;
}

// An answer to Arm and to Home: the move and what became of the request.
template <class Reply>
Decoded<UnitMessage> DecodeAnswer(const CanFrame& frame) {
  Reply m{.move = {U16(frame, 0)}};
  if (!Valid(frame.data[2], kAnswerCount, &m.answer)) return tl::unexpected(Malformed::kValue);
  return m;
}

Decoded<UnitMessage> DecodeUnitBody(const CanFrame& frame, const Opened& open) {
  const auto check = [&](std::uint8_t length, std::uint8_t detail_max = 0) {
    return Check(frame, open, {length, detail_max});
  };
  switch (open.function) {
    case Function::kDone:
      return check(8, kOutcomeCount - 1).map([&] {
        return UnitMessage{Done{
            static_cast<Outcome>(open.detail), {S24(frame, 0), S24(frame, 3)}, {U16(frame, 6)}}};
      });
    case Function::kProgress:
      return check(8, kUnitStateCount - 1).map([&] {
        return UnitMessage{ProgressReply{
            static_cast<UnitState>(open.detail), {S24(frame, 0), S24(frame, 3)}, {U16(frame, 6)}}};
      });
    case Function::kClock:
      return check(4).map([&] { return UnitMessage{ClockReply{Unsigned(frame, 0, 4)}}; });
    case Function::kArm:
      return check(3).and_then([&] { return DecodeAnswer<ArmReply>(frame); });
    case Function::kHome:
      return check(3).and_then([&] { return DecodeAnswer<HomeReply>(frame); });
    case Function::kConfirm:
      return check(8).and_then([&] { return DecodeConfirm(frame); });
    case Function::kStatus:
      return check(8).and_then([&] { return DecodeStatus(frame); });
    case Function::kVector:
      return check(8, 1).and_then(
          [&] { return DecodeVector(frame, static_cast<Axis>(open.detail)); });
    case Function::kFault:
      return check(6).and_then([&] { return DecodeFault(frame); });
    case Function::kIdentify:
      return check(8).map([&] {
        return UnitMessage{IdentifyReply{
            {Unsigned(frame, 0, 4)}, frame.data[4], frame.data[5], frame.data[6], frame.data[7]}};
      });
    case Function::kParameterRead:
    case Function::kParameterWrite:
      return check(6, 1).and_then([&] { return DecodeParameter(frame, open); });
    case Function::kStop:
    case Function::kStart:
    case Function::kStageBegin:
    case Function::kStageSegment:
      break;
  }
  return tl::unexpected(Malformed::kDirection);
}

}  // namespace

CanFrame Encode(const HostMessage& message, Address address) {
  return std::visit(HostEncoder{address}, message);
}

CanFrame Encode(const UnitMessage& message, Address address) {
  return std::visit(UnitEncoder{address}, message);
}

tl::expected<Addressed<HostMessage>, Malformed> DecodeHost(const CanFrame& frame) {
  const auto open = Open(frame, false);
  if (!open) return tl::unexpected(open.error());
  return DecodeHostBody(frame, *open).map([&](HostMessage m) {
    return Addressed<HostMessage>{open->address, m};
  });
}

tl::expected<Addressed<UnitMessage>, Malformed> DecodeUnit(const CanFrame& frame) {
  const auto open = Open(frame, true);
  if (!open) return tl::unexpected(open.error());
  return DecodeUnitBody(frame, *open).map([&](UnitMessage m) {
    return Addressed<UnitMessage>{open->address, m};
  });
}

}  // namespace focalfleet
