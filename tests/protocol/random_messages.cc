#include "tests/protocol/random_messages.h"

#include <sstream>
#include <type_traits>

namespace focalfleet::test {
namespace {

template <class T>
T Draw(Rng& rng, std::uint64_t count) {
  return static_cast<T>(rng.Below(count));
}
// Small, large and middle values come equally often: a width that is one bit short must not hide
// behind rare draws.
std::uint64_t Wide(Rng& rng, unsigned bits) {
  const std::uint64_t all = bits == 64 ? ~0ull : (1ull << bits) - 1;
  switch (rng.Below(6)) {
    case 0:
      return 0;
    case 1:
      return all;
    case 2:
      return 1ull << rng.Below(bits);
    default:
      return rng.Bits() & all;
  }
}
template <class T>
T Whole(Rng& rng) {
  return static_cast<T>(Wide(rng, 8 * sizeof(T)));
}
std::int32_t Signed24(Rng& rng) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(Wide(rng, 24)) << 8) >> 8;
}
// A position: one value of the 24 bits means no position.
std::int32_t Position24(Rng& rng) {
  const std::int32_t drawn = Signed24(rng);
  return drawn < -8388607 ? -8388607 : drawn;
}
Axis AnyAxis(Rng& rng) { return Draw<Axis>(rng, 2); }
MoveId AnyMove(Rng& rng) { return {Whole<std::uint16_t>(rng)}; }
Parameter AnyParameter(Rng& rng) { return Draw<Parameter>(rng, 9); }
Answer AnyAnswer(Rng& rng) { return Draw<Answer>(rng, 8); }
std::uint32_t Ticks24(Rng& rng) { return static_cast<std::uint32_t>(Wide(rng, 24)); }

void Fill(Rng& rng, Start* m) { *m = {AnyMove(rng), Ticks24(rng)}; }
void Fill(Rng& rng, Clock* m) { m->host_us = Wide(rng, 48); }
void Fill(Rng& rng, Arm* m) { *m = {AnyMove(rng), Whole<std::uint32_t>(rng)}; }
void Fill(Rng& rng, Confirm* m) { m->move = AnyMove(rng); }
void Fill(Rng& rng, StageBegin* m) {
  const auto move = static_cast<std::uint16_t>(1 + rng.Below(65535));
  *m = {{move}, {Draw<std::uint8_t>(rng, 16), Draw<std::uint8_t>(rng, 16)}, Draw<WaveMode>(rng, 3)};
}
void Fill(Rng& rng, StageSegment* m) {
  m->axis = AnyAxis(rng);
  m->index = Draw<std::uint8_t>(rng, 15);
  const auto repeat = static_cast<std::uint8_t>(1 + rng.Below(255));
  m->segment = {Ticks24(rng), Signed24(rng), repeat};
}
void Fill(Rng& rng, Home* m) { m->move = AnyMove(rng); }
void Fill(Rng& rng, StatusRequest* m) { m->resume = rng.Below(2) != 0; }
void Fill(Rng& rng, VectorRequest* m) { m->axis = AnyAxis(rng); }
void Fill(Rng& rng, FaultRequest* m) { m->clear = rng.Below(2) != 0; }
void Fill(Rng& rng, ParameterRead* m) { *m = {AnyAxis(rng), AnyParameter(rng)}; }
void Fill(Rng& rng, ParameterWrite* m) {
  *m = {AnyAxis(rng), AnyParameter(rng), Whole<std::int32_t>(rng)};
}
void Fill(Rng& rng, SensorsRequest* m) { m->part = Draw<std::uint8_t>(rng, kSensorParts); }

void Fill(Rng& rng, Done* m) {
  *m = {Draw<Outcome>(rng, 4), {Position24(rng), Position24(rng)}, AnyMove(rng)};
}
void Fill(Rng& rng, ClockReply* m) {
  m->ticks = Whole<std::uint32_t>(rng);
  m->began_ticks = Whole<std::uint32_t>(rng);
}
void Fill(Rng& rng, ArmReply* m) { *m = {AnyMove(rng), AnyAnswer(rng)}; }
void Fill(Rng& rng, ConfirmReply* m) {
  *m = {AnyMove(rng),
        Whole<std::uint32_t>(rng),
        {Draw<std::uint8_t>(rng, 16), Draw<std::uint8_t>(rng, 16)},
        AnyAnswer(rng)};
}
void Fill(Rng& rng, HomeReply* m) { *m = {AnyMove(rng), AnyAnswer(rng)}; }
void Fill(Rng& rng, ProgressReply* m) {
  *m = {Draw<UnitState>(rng, 7), {Position24(rng), Position24(rng)}, AnyMove(rng)};
}
void Fill(Rng& rng, StatusReply* m) {
  *m = {.state = Draw<UnitState>(rng, 7),
        .fault = Draw<FaultCode>(rng, 6),
        .interrupted = rng.Below(2) != 0,
        .host_lost = rng.Below(2) != 0,
        .restarted = rng.Below(2) != 0,
        .progress_percent = Draw<std::uint8_t>(rng, 101),
        .move = AnyMove(rng),
        .moves_begun = Whole<std::uint16_t>(rng)};
}
void Fill(Rng& rng, VectorReply* m) {
  const auto subdivision = static_cast<std::uint16_t>(1 + rng.Below(65535));
  const std::int64_t position = static_cast<std::int64_t>(rng.Below(2 * 8388607ull + 1)) - 8388607;
  std::int64_t turns = position / subdivision;
  std::int64_t vector = position % subdivision;
  if (vector < 0) {
    vector += subdivision;
    --turns;
  }
  *m = {AnyAxis(rng), static_cast<std::uint16_t>(vector), subdivision,
        static_cast<std::int32_t>(turns)};
}
void Fill(Rng& rng, FaultReply* m) {
  *m = {Draw<FaultCode>(rng, 6), AnyAxis(rng), AnyMove(rng), Whole<std::uint16_t>(rng)};
}
void Fill(Rng& rng, IdentifyReply* m) {
  *m = {{Whole<std::uint32_t>(rng)},
        Whole<std::uint8_t>(rng),
        Whole<std::uint8_t>(rng),
        Whole<std::uint8_t>(rng),
        Whole<std::uint8_t>(rng)};
}
void Fill(Rng& rng, ParameterReply* m) {
  *m = {rng.Below(2) != 0, AnyAxis(rng), AnyParameter(rng), AnyAnswer(rng),
        Whole<std::int32_t>(rng)};
}
void Fill(Rng& rng, SensorsReply* m) {
  m->part = Draw<std::uint8_t>(rng, kSensorParts);
  for (std::uint16_t& count : m->counts) count = Whole<std::uint16_t>(rng);
}

template <class T>
void Fill(Rng&, T*) {  // the messages without fields
  static_assert(std::is_empty_v<T>);
}

template <class Variant, std::size_t i = 0>
Variant Make(std::size_t alternative, Rng& rng) {
  if constexpr (i + 1 < std::variant_size_v<Variant>)
    if (alternative != i) return Make<Variant, i + 1>(alternative, rng);
  std::variant_alternative_t<i, Variant> message;
  Fill(rng, &message);
  return message;
}

// ---- text of a message

class Text {
 public:
  template <class T>
  Text& operator<<(const T& value) {
    if constexpr (std::is_enum_v<T> || std::is_same_v<T, std::uint8_t> || std::is_same_v<T, bool>)
      out_ << static_cast<int>(value) << ' ';
    else
      out_ << value << ' ';
    return *this;
  }
  Text& operator<<(MoveId move) { return *this << move.value; }
  template <class T>
  Text& operator<<(const std::array<T, kAxisCount>& pair) {
    return *this << pair[0] << pair[1];
  }
  [[nodiscard]] std::string text() const { return out_.str(); }

 private:
  std::ostringstream out_;
};

void Put(Text& out, const Start& m) { out << m.move << m.delay_ticks; }
void Put(Text& out, const Clock& m) { out << m.host_us; }
void Put(Text& out, const Arm& m) { out << m.move << m.digest; }
void Put(Text& out, const Confirm& m) { out << m.move; }
void Put(Text& out, const StageBegin& m) { out << m.move << m.segments << m.mode; }
void Put(Text& out, const StageSegment& m) {
  out << m.axis << m.index << m.segment.start_ticks << m.segment.delta << m.segment.repeat;
}
void Put(Text& out, const Home& m) { out << m.move; }
void Put(Text& out, const StatusRequest& m) { out << m.resume; }
void Put(Text& out, const VectorRequest& m) { out << m.axis; }
void Put(Text& out, const FaultRequest& m) { out << m.clear; }
void Put(Text& out, const ParameterRead& m) { out << m.axis << m.parameter; }
void Put(Text& out, const ParameterWrite& m) { out << m.axis << m.parameter << m.value; }
void Put(Text& out, const Done& m) { out << m.outcome << m.position << m.move; }
void Put(Text& out, const ClockReply& m) { out << m.ticks << m.began_ticks; }
void Put(Text& out, const ArmReply& m) { out << m.move << m.answer; }
void Put(Text& out, const ConfirmReply& m) { out << m.move << m.digest << m.segments << m.answer; }
void Put(Text& out, const HomeReply& m) { out << m.move << m.answer; }
void Put(Text& out, const ProgressReply& m) { out << m.state << m.position << m.move; }
void Put(Text& out, const StatusReply& m) {
  out << m.state << m.fault << m.interrupted << m.host_lost << m.restarted << m.progress_percent
      << m.move << m.moves_begun;
}
void Put(Text& out, const VectorReply& m) { out << m.axis << m.vector << m.subdivision << m.turns; }
void Put(Text& out, const FaultReply& m) { out << m.code << m.axis << m.move << m.count; }
void Put(Text& out, const IdentifyReply& m) {
  out << m.serial.value << m.protocol_version << m.firmware_major << m.firmware_minor << m.hardware;
}
void Put(Text& out, const ParameterReply& m) {
  out << m.written << m.axis << m.parameter << m.answer << m.value;
}
void Put(Text& out, const SensorsRequest& m) { out << m.part; }
void Put(Text& out, const SensorsReply& m) {
  out << m.part;
  for (const std::uint16_t count : m.counts) out << count;
}
template <class T>
void Put(Text&, const T&) {
  static_assert(std::is_empty_v<T>);
}

template <class Variant>
std::string ShowAny(const Variant& message) {
  Text out;
  out << message.index();
  std::visit([&](const auto& m) { Put(out, m); }, message);
  return out.text();
}

}  // namespace

HostMessage RandomHost(std::size_t alternative, Rng& rng) {
  return Make<HostMessage>(alternative, rng);
}
UnitMessage RandomUnit(std::size_t alternative, Rng& rng) {
  return Make<UnitMessage>(alternative, rng);
}
HostMessage RandomHost(Rng& rng) {
  return RandomHost(rng.Below(std::variant_size_v<HostMessage>), rng);
}
UnitMessage RandomUnit(Rng& rng) {
  return RandomUnit(rng.Below(std::variant_size_v<UnitMessage>), rng);
}

std::string Show(const HostMessage& message) { return ShowAny(message); }
std::string Show(const UnitMessage& message) { return ShowAny(message); }

}  // namespace focalfleet::test
