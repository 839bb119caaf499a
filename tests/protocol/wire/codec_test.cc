#include "protocol/wire/codec.h"

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "tests/protocol/random_messages.h"
#include "tests/support/alloc_guard.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::AllocGuard;
using test::RandomHost;
using test::RandomUnit;
using test::Show;
using test::TestSeed;

constexpr int kDraws = 20'000;

bool SameBits(const CanFrame& a, const CanFrame& b) {
  return a.id == b.id && a.length == b.length &&
         std::equal(a.payload().begin(), a.payload().end(), b.payload().begin());
}

std::string Print(const CanFrame& frame) {
  char text[64];
  int n = std::snprintf(text, sizeof text, "%08X#", frame.id);
  for (const std::uint8_t byte : frame.payload())
    n += std::snprintf(text + n, sizeof text - static_cast<std::size_t>(n), "%02X", byte);
  return text;
}

Address RandomAddress(Rng& rng, bool from_unit) {
  const auto node = static_cast<std::uint8_t>(rng.Below(from_unit ? 255 : 256));
  return {{node}, static_cast<std::uint8_t>(rng.Below(256))};
}

// The frame that a message encodes to is the only one that decodes to it.
void ExpectInjective(const CanFrame& frame) {
  if (const auto host = DecodeHost(frame)) {
    const CanFrame again = Encode(host->message, host->address);
    EXPECT_TRUE(SameBits(again, frame)) << Print(frame) << " comes back as " << Print(again);
    EXPECT_FALSE(DecodeUnit(frame)) << Print(frame) << " is a message of both directions";
  }
  if (const auto unit = DecodeUnit(frame)) {
    const CanFrame again = Encode(unit->message, unit->address);
    EXPECT_TRUE(SameBits(again, frame)) << Print(frame) << " comes back as " << Print(again);
  }
}

template <class Function>
void ForSingleBitFlips(const CanFrame& frame, Function function) {
  for (int bit = 0; bit < 32; ++bit) {
    CanFrame flipped = frame;
    flipped.id ^= 1u << bit;
    function(flipped);
  }
  for (std::size_t bit = 0; bit < 64; ++bit) {
    CanFrame flipped = frame;
    flipped.data[bit / 8] = static_cast<std::uint8_t>(flipped.data[bit / 8] ^ 1u << bit % 8);
    function(flipped);
  }
  for (int length = 0; length < 256; ++length) {
    CanFrame other = frame;
    other.length = static_cast<std::uint8_t>(length);
    if (length != frame.length) function(other);
  }
}

TEST(Codec, HostMessagesComeBackAsTheyWere) {
  const auto seed = TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < kDraws; ++i) {
    const HostMessage message = RandomHost(rng);
    const Address address = RandomAddress(rng, false);
    const auto back = DecodeHost(Encode(message, address));
    ASSERT_TRUE(back) << Name(back.error()) << ": " << Show(message);
    ASSERT_EQ(Show(back->message), Show(message));
    ASSERT_EQ(back->address, address);
  }
}

TEST(Codec, UnitMessagesComeBackAsTheyWere) {
  const auto seed = TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < kDraws; ++i) {
    const UnitMessage message = RandomUnit(rng);
    const Address address = RandomAddress(rng, true);
    const auto back = DecodeUnit(Encode(message, address));
    ASSERT_TRUE(back) << Name(back.error()) << ": " << Show(message);
    ASSERT_EQ(Show(back->message), Show(message));
    ASSERT_EQ(back->address, address);
  }
}

TEST(Codec, EveryNodeAndSequenceNumberComesBack) {
  for (unsigned node = 0; node < 256; ++node) {
    for (unsigned sequence = 0; sequence < 256; ++sequence) {
      const Address address{{static_cast<std::uint8_t>(node)}, static_cast<std::uint8_t>(sequence)};
      const auto host = DecodeHost(Encode(HostMessage{Confirm{{7}}}, address));
      ASSERT_TRUE(host);
      ASSERT_EQ(host->address, address);
      const auto unit = DecodeUnit(Encode(UnitMessage{ClockReply{7}}, address));
      if (node == kBroadcastNode.value) {
        ASSERT_FALSE(unit);
        ASSERT_EQ(unit.error(), Malformed::kNode);
      } else {
        ASSERT_EQ(unit.value().address, address);
      }
    }
  }
}

// The bytes of docs/protocol.md, worked out by hand.
struct Golden {
  const char* candump;
  CanFrame frame;
};

std::vector<Golden> GoldenHostFrames() {
  const Address to{{0x2A}, 0x5C};
  const auto host = [&](const HostMessage& m) { return Encode(m, to); };
  return {
      {"000152E0#", host(Stop{})},
      {"0007F800#", Encode(HostMessage{Stop{}}, {kBroadcastNode, 0})},
      {"041152E0#341256AB00", host(Start{{0x1234}, 0xAB56})},
      {"083152E0#060504030201", host(Clock{0x010203040506})},
      {"083152E1#", host(ClockRequest{})},
      {"0C4152E0#3412EFBEADDE", host(Arm{{0x1234}, 0xDEADBEEF})},
      {"107152E0#3412", host(Confirm{{0x1234}})},
      {"105152E0#3412030F02", host(StageBegin{{0x1234}, {3, 15}, WaveMode::kSevenSegment})},
      {"106152E0#05010203FEFFFF6C", host(StageSegment{Axis::kTheta, 5, {0x030201, -2, 108}})},
      {"106152E1#0000000001000025", host(StageSegment{Axis::kPhi, 0, {0, 1, 37}})},
      {"108152E0#3412", host(Home{{0x1234}})},
      {"149152E0#", host(ProgressRequest{})},
      {"14A152E0#", host(StatusRequest{false})},
      {"14A152E1#", host(StatusRequest{true})},
      {"14B152E1#", host(VectorRequest{Axis::kPhi})},
      {"14C152E0#", host(FaultRequest{false})},
      {"14C152E1#", host(FaultRequest{true})},
      {"18D152E0#", host(IdentifyRequest{})},
      {"18E152E1#08", host(ParameterRead{Axis::kPhi, Parameter::kHostTimeoutMs})},
      {"151152E1#", host(SensorsRequest{1})},
      {"18F152E0#04FEFFFFFF", host(ParameterWrite{Axis::kTheta, Parameter::kPosition, -2})},
  };
}

std::vector<Golden> GoldenUnitFrames() {
  const Address from{{0x2A}, 0x5C};
  const auto unit = [&](const UnitMessage& m) { return Encode(m, from); };
  return {
      {"082952E2#FFFFFF0201003412", unit(Done{Outcome::kFault, {-1, 0x102}, {0x1234}})},
      {"083952E0#0403020108070605", unit(ClockReply{0x01020304, 0x05060708})},
      {"0C4952E0#341205", unit(ArmReply{{0x1234}, Answer::kBegunBefore})},
      {"107952E0#3412EFBEADDE3F02",
       unit(ConfirmReply{{0x1234}, 0xDEADBEEF, {15, 3}, Answer::kIncomplete})},
      {"108952E0#341207", unit(HomeReply{{0x1234}, Answer::kInterrupted})},
      {"149952E3#010080FFFF7F3412",
       unit(ProgressReply{UnitState::kMoving, {-0x7FFFFF, 0x7FFFFF}, {0x1234}})},
      {"14A952E0#0501056434120201", unit(StatusReply{UnitState::kFault,
                                                     FaultCode::kOverTemperature,
                                                     true,
                                                     false,
                                                     true,
                                                     100,
                                                     {0x1234},
                                                     0x0102})},
      {"14A952E0#0600020000000000",
       unit(StatusReply{.state = UnitState::kHostLost, .host_lost = true})},
      {"14B952E1#5F006000FEFFFFFF", unit(VectorReply{Axis::kPhi, 95, 96, -2})},
      {"14C952E0#030134120500", unit(FaultReply{FaultCode::kOverCurrent, Axis::kPhi, {0x1234}, 5})},
      {"18D952E0#0403020101020304", unit(IdentifyReply{{0x01020304}, 1, 2, 3, 4})},
      {"18E952E0#0200 60000000",
       unit(ParameterReply{false, Axis::kTheta, Parameter::kSubdivision, Answer::kOk, 96})},
      {"151952E1#01020304FFFFFEFF", unit(SensorsReply{1, {0x0201, 0x0403, kNoCount, kFullCount}})},
      {"18F952E1#040600000080",
       unit(ParameterReply{true, Axis::kPhi, Parameter::kPosition, Answer::kBadValue, INT32_MIN})},
  };
}

TEST(Codec, FramesHaveTheDocumentedBytes) {
  std::set<std::size_t> host_kinds;
  std::set<std::size_t> unit_kinds;
  for (const auto& [text, frame] : GoldenHostFrames()) {
    EXPECT_EQ(Print(frame), text);
    host_kinds.insert(DecodeHost(frame).value().message.index());
  }
  for (const auto& [text, frame] : GoldenUnitFrames()) {
    std::string wanted;
    for (const char* c = text; *c != 0; ++c)
      if (*c != ' ') wanted += *c;
    EXPECT_EQ(Print(frame), wanted);
    unit_kinds.insert(DecodeUnit(frame).value().message.index());
  }
  EXPECT_EQ(host_kinds.size(), std::variant_size_v<HostMessage>);
  EXPECT_EQ(unit_kinds.size(), std::variant_size_v<UnitMessage>);
}

TEST(Codec, EverySingleBitFlipDecodesOrIsMalformed) {
  const auto seed = TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 300; ++i) {
    ForSingleBitFlips(Encode(RandomHost(rng), RandomAddress(rng, false)), ExpectInjective);
    ForSingleBitFlips(Encode(RandomUnit(rng), RandomAddress(rng, true)), ExpectInjective);
  }
}

TEST(Codec, EveryIdentifierWithAnyBytesDecodesToOneFrameOrNone) {
  const auto seed = TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int decoded = 0;
  for (std::uint32_t prefix = 0; prefix < 1u << 10; ++prefix) {  // priority, function, direction
    for (std::uint32_t detail = 0; detail < 8; ++detail) {
      for (std::uint8_t length = 0; length <= 9; ++length) {
        for (int draw = 0; draw < 8; ++draw) {
          CanFrame frame{
              prefix << 19 | static_cast<std::uint32_t>(rng.Below(1u << 16)) << 3 | detail,
              length,
              {}};
          // Small bytes let enumerators and counts pass their checks often enough.
          for (auto& byte : frame.data)
            byte = static_cast<std::uint8_t>(rng.Below(draw % 2 == 0 ? 4 : 256));
          ExpectInjective(frame);
          decoded += DecodeHost(frame) || DecodeUnit(frame) ? 1 : 0;
        }
      }
    }
  }
  EXPECT_GT(decoded, 200);
}

// Each frame is malformed in a single way, and each malformation has its own name.
TEST(Codec, EachBrokenRuleIsNamed) {
  const Address unit{{3}, 9};
  const CanFrame confirm = Encode(HostMessage{Confirm{{7}}}, unit);
  const auto host_error = [](const CanFrame& frame) { return DecodeHost(frame).error(); };
  const auto unit_error = [](const CanFrame& frame) { return DecodeUnit(frame).error(); };

  CanFrame bad = confirm;
  bad.id |= 1u << 29;
  EXPECT_EQ(host_error(bad), Malformed::kIdentifier);
  bad = confirm;
  bad.id ^= 1u << 26;
  EXPECT_EQ(host_error(bad), Malformed::kFunction) << "wrong priority";
  bad = confirm;
  bad.id |= 16u << 20;
  EXPECT_EQ(host_error(bad), Malformed::kFunction) << "function 16 and above";
  EXPECT_EQ(unit_error(confirm), Malformed::kDirection);
  bad = confirm;
  bad.id |= 1;
  EXPECT_EQ(host_error(bad), Malformed::kReserved);
  bad = confirm;
  bad.length = 9;
  EXPECT_EQ(host_error(bad), Malformed::kLength);
  bad.length = 1;
  EXPECT_EQ(host_error(bad), Malformed::kLength);

  CanFrame status = Encode(UnitMessage{StatusReply{}}, unit);
  status.data[2] = 8;
  EXPECT_EQ(unit_error(status), Malformed::kReserved);
  status.data[2] = 0;
  status.data[3] = 101;
  EXPECT_EQ(unit_error(status), Malformed::kValue);
}

// Every enumerator byte takes all values: exactly the documented ones are accepted.
TEST(Codec, EnumeratorsAreCheckedOverAll256Values) {
  struct Field {
    CanFrame frame;
    std::size_t at;
    std::uint32_t low, high;
  };
  const Address a{{3}, 0};
  const auto host = [&](const HostMessage& m) { return Encode(m, a); };
  const auto unit = [&](const UnitMessage& m) { return Encode(m, a); };
  const Field fields[] = {
      {host(StageBegin{{1}, {}, {}}), 2, 0, 15},
      {host(StageBegin{{1}, {}, {}}), 3, 0, 15},
      {host(StageBegin{{1}, {}, {}}), 4, 0, 2},
      {host(StageSegment{{}, 0, {0, 0, 1}}), 0, 0, 14},
      {host(StageSegment{{}, 0, {0, 0, 1}}), 7, 1, 255},
      {host(ParameterRead{}), 0, 0, 8},
      {host(ParameterWrite{}), 0, 0, 8},
      {unit(ArmReply{}), 2, 0, 7},
      {unit(HomeReply{}), 2, 0, 7},
      {unit(ConfirmReply{}), 7, 0, 7},
      {unit(StatusReply{}), 0, 0, 6},
      {unit(StatusReply{}), 1, 0, 5},
      {unit(StatusReply{}), 2, 0, 7},
      {unit(StatusReply{}), 3, 0, 100},
      {unit(FaultReply{}), 0, 0, 5},
      {unit(FaultReply{}), 1, 0, 1},
      {unit(ParameterReply{}), 0, 0, 8},
      {unit(ParameterReply{}), 1, 0, 7},
  };
  for (const Field& field : fields) {
    for (std::uint32_t value = 0; value < 256; ++value) {
      CanFrame frame = field.frame;
      frame.data[field.at] = static_cast<std::uint8_t>(value);
      const bool taken = DecodeHost(frame) || DecodeUnit(frame);
      EXPECT_EQ(taken, field.low <= value && value <= field.high)
          << Print(frame) << " byte " << field.at;
    }
  }
}

TEST(Codec, DetailBitsAreCheckedForEveryFunction) {
  // The highest detail that each function takes, by direction; -1: no such message.
  const int host_max[kFunctionCount] = {0, 0, -1, 1, 0, 0, 1, 0, 0, 0, 1, 1, 1, 0, 1, 1, -1, 3};
  const int unit_max[kFunctionCount] = {-1, -1, 3, 0, 0, -1, -1, 0, 0, 6, 0, 1, 0, 0, 1, 1, -1, 3};
  for (std::uint32_t f = 0; f < kFunctionCount; ++f) {
    int host_seen = -1;
    int unit_seen = -1;
    for (std::uint8_t detail = 0; detail < 8; ++detail) {
      for (std::uint8_t length = 0; length <= 8; ++length) {
        for (int bytes = 0; bytes < 3; ++bytes) {
          CanFrame frame{Pack({static_cast<Function>(f), false, {{1}, 1}, detail}), length, {}};
          if (bytes == 1) frame.data.fill(1);
          if (bytes == 2) frame.data[2] = 1;  // a subdivision of 1
          if (DecodeHost(frame)) host_seen = detail;
          frame.id |= 1u << 19;
          if (DecodeUnit(frame)) unit_seen = detail;
        }
      }
    }
    EXPECT_EQ(host_seen, host_max[f]) << kFunctions[f].name;
    EXPECT_EQ(unit_seen, unit_max[f]) << kFunctions[f].name;
  }
}

TEST(Codec, AVectorReplyOutsideItsRangeIsRefused) {
  const auto decode = [](VectorReply m) { return DecodeUnit(Encode(UnitMessage{m}, {{1}, 1})); };
  EXPECT_TRUE(decode({Axis::kTheta, 95, 96, 0}));
  EXPECT_FALSE(decode({Axis::kTheta, 96, 96, 0})) << "the vector is not below the subdivision";
  EXPECT_FALSE(decode({Axis::kTheta, 0, 0, 0})) << "a subdivision of 0";
  EXPECT_TRUE(decode({Axis::kTheta, 0, 1, 8388607}));
  EXPECT_FALSE(decode({Axis::kTheta, 0, 1, 8388608}));
  EXPECT_TRUE(decode({Axis::kTheta, 0, 1, -8388607}));
  EXPECT_FALSE(decode({Axis::kTheta, 0, 1, -8388608}));
  EXPECT_FALSE(decode({Axis::kTheta, 0, 65535, INT32_MIN}));
}

TEST(Codec, TheLowestNumberOf24BitsIsNoPosition) {
  for (const UnitMessage& m : {UnitMessage{Done{Outcome::kArrived, {-0x7FFFFF, 0}, {1}}},
                               UnitMessage{ProgressReply{UnitState::kRest, {-0x7FFFFF, 0}, {1}}}}) {
    CanFrame frame = Encode(m, {{1}, 1});
    EXPECT_TRUE(DecodeUnit(frame));
    frame.data[0] = 0;
    EXPECT_FALSE(DecodeUnit(frame));
  }
}

TEST(Codec, UsesNoHeap) {
  Rng rng(6);
  std::vector<CanFrame> frames;
  std::vector<HostMessage> host;
  std::vector<UnitMessage> unit;
  for (int i = 0; i < 1000; ++i) {
    host.push_back(RandomHost(rng));
    unit.push_back(RandomUnit(rng));
    frames.push_back(Encode(host.back(), {{1}, 1}));
    frames.push_back(Encode(unit.back(), {{1}, 1}));
    frames.push_back({static_cast<std::uint32_t>(rng.Bits()), 8, {}});
  }
  std::uint32_t sum = 0;
  const test::AllocGuard guard;
  for (const HostMessage& m : host) sum += Encode(m, {{1}, 1}).id;
  for (const UnitMessage& m : unit) sum += Encode(m, {{1}, 1}).id;
  for (const CanFrame& frame : frames)
    sum += (DecodeHost(frame) ? 1u : 0u) + (DecodeUnit(frame) ? 1u : 0u);
  EXPECT_EQ(guard.allocations(), 0u) << sum;
}

TEST(AllocGuard, CountsWhatItShouldForbid) {
  const test::AllocGuard guard;
  int* volatile number =
      new int(3);  // volatile: an optimiser may remove an allocation without effect
  delete number;
  EXPECT_GE(guard.allocations(), 1u);
}

}  // namespace
}  // namespace focalfleet
