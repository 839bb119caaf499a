#include "protocol/wire/frame_bits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "protocol/base/rng.h"
#include "protocol/wire/codec.h"
#include "tests/protocol/random_messages.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

// The oracle writes a frame as a string of '0' and '1', by the field list of ISO 11898-1. The check
// sequence comes from long division, and the stuffing from the string.
std::string Binary(std::uint32_t value, int count) {
  std::string text;
  for (int i = count - 1; i >= 0; --i) text += (value >> i & 1) != 0 ? '1' : '0';
  return text;
}

std::string CrcByDivision(const std::string& message) {
  const std::string divisor = "1100010110011001";  // x^15 and 0x4599
  std::string rest = message + std::string(15, '0');
  for (std::size_t i = 0; i < message.size(); ++i)
    if (rest[i] == '1')
      for (std::size_t k = 0; k < divisor.size(); ++k)
        rest[i + k] = rest[i + k] == divisor[k] ? '0' : '1';
  return rest.substr(message.size());
}

std::string Stuffed(const std::string& bits) {
  std::string out;
  for (const char bit : bits) {
    out += bit;
    if (out.size() >= 5 && out.find_first_not_of(bit, out.size() - 5) == std::string::npos)
      out += bit == '0' ? '1' : '0';
  }
  return out;
}

std::string BeforeCrc(const CanFrame& frame) {
  std::string bits = "0" + Binary(frame.id >> 18, 11) + "11" + Binary(frame.id, 18) + "000" +
                     Binary(frame.length, 4);
  for (const std::uint8_t byte : frame.payload()) bits += Binary(byte, 8);
  return bits;
}

std::string WithoutStuffing(const FrameLevels& levels) {
  std::string bits;
  for (std::uint32_t i = 0; i < levels.bits; ++i)
    if (!levels.stuff[i]) bits += levels.recessive[i] ? '1' : '0';
  return bits;
}

std::uint32_t OracleBits(const CanFrame& frame) {
  const std::string bits = BeforeCrc(frame);
  const std::string tail =
      "1"  // CRC delimiter
      "1"
      "1"  // ACK slot and delimiter
      "1111111"
      "111";
  return static_cast<std::uint32_t>((Stuffed(bits + CrcByDivision(bits)) + tail).size());
}

CanFrame RandomFrame(Rng& rng) {
  CanFrame frame{
      static_cast<std::uint32_t>(rng.Below(1u << 29)), static_cast<std::uint8_t>(rng.Below(9)), {}};
  const std::uint64_t kind = rng.Below(4);
  for (auto& byte : frame.data) {
    constexpr std::uint8_t kRuns[] = {0x00, 0xFF, 0x0F, 0xF0, 0x87, 0x78, 0xC3, 0x1E};
    byte = kind == 0 ? static_cast<std::uint8_t>(rng.Below(256)) : kRuns[rng.Below(8)];
  }
  return frame;
}

TEST(FrameBits, TheOraclesCrcIsThePublishedOne) {
  std::string digits;
  for (const char c : std::string("123456789")) digits += Binary(static_cast<std::uint8_t>(c), 8);
  EXPECT_EQ(CrcByDivision(digits), Binary(0x059E, 15)) << "check value of CRC-15/CAN";
}

TEST(FrameBits, EqualsTheLengthOfTheFrameWrittenOut) {
  const auto seed = test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 20'000; ++i) {
    const CanFrame frame = RandomFrame(rng);
    ASSERT_EQ(FrameBits(frame), OracleBits(frame)) << std::hex << frame.id;
    const std::string before_crc = BeforeCrc(frame);
    ASSERT_EQ(WithoutStuffing(LevelsOf(frame)), before_crc + CrcByDivision(before_crc))
        << std::hex << frame.id;
  }
}

TEST(FrameBits, EqualsTheLengthOfEveryMessageWrittenOut) {
  Rng rng(12);
  for (std::size_t i = 0; i < 2000; ++i) {
    const CanFrame host = Encode(test::RandomHost(rng), {{static_cast<std::uint8_t>(i)}, 1});
    const CanFrame unit = Encode(test::RandomUnit(rng), {{static_cast<std::uint8_t>(i)}, 1});
    ASSERT_EQ(FrameBits(host), OracleBits(host));
    ASSERT_EQ(FrameBits(unit), OracleBits(unit));
  }
}

TEST(FrameBits, StaysWithinTheKnownBounds) {
  Rng rng(13);
  for (int i = 0; i < 20'000; ++i) {
    const CanFrame frame = RandomFrame(rng);
    const std::uint32_t stuffable = 54 + 8u * frame.length;
    ASSERT_GE(FrameBits(frame), stuffable + 13);
    ASSERT_LE(FrameBits(frame), stuffable + 13 + (stuffable - 1) / 4);
    ASSERT_LE(FrameBits(frame), kFrameBitsMax);
  }
  static_assert(kFrameBitsMax == 54 + 64 + 13 + (54 + 64 - 1) / 4);
}

// The same for CAN FD: the stuffed part comes from the string, the rest from counting its fields.
FdFrameBits OracleBits(const FdFrame& frame) {
  const std::string nominal = "0" + Binary(frame.id >> 18, 11) + "11" + Binary(frame.id, 18) +
                              "0"
                              "1"
                              "0"
                              "1";
  const auto code = std::find(kFdLengths.begin(), kFdLengths.end(), frame.length);
  std::string all =
      nominal + "0" + Binary(static_cast<std::uint32_t>(code - kFdLengths.begin()), 4);
  for (const std::uint8_t byte : frame.payload()) all += Binary(byte, 8);
  // No stuff bit follows the last bit, where the fixed stuff bits begin.
  const std::string wire = Stuffed(all.substr(0, all.size() - 1)) + all.back();
  const std::string start = Stuffed(nominal);
  const std::uint32_t fixed = frame.length > 16 ? 4 + 21 + 7 : 4 + 17 + 6;
  return {static_cast<std::uint32_t>(start.size()) + 1 + 1 + 7 + 3,
          static_cast<std::uint32_t>(wire.size() - start.size()) + fixed + 1};
}

TEST(FrameBits, OfCanFdEqualTheFrameWrittenOut) {
  const auto seed = test::TestSeed(14);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 20'000; ++i) {
    FdFrame frame{static_cast<std::uint32_t>(rng.Below(1u << 29)), kFdLengths[rng.Below(16)], {}};
    const bool runs = rng.Below(2) == 0;
    for (auto& byte : frame.data) {
      constexpr std::uint8_t kRuns[] = {0x00, 0xFF, 0x0F, 0xF0, 0x87, 0x78, 0xC3, 0x1F};
      byte = runs ? kRuns[rng.Below(8)] : static_cast<std::uint8_t>(rng.Below(256));
    }
    const FdFrameBits bits = FrameBits(frame);
    const FdFrameBits oracle = OracleBits(frame);
    ASSERT_EQ(bits.nominal, oracle.nominal) << i;
    ASSERT_EQ(bits.data, oracle.data) << i;
  }
}

TEST(FrameBits, NoGroupIsLongerThanTheLongest) {
  const auto seed = test::TestSeed(15);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 20'000; ++i) {
    FdFrame group{.id = kGroupId, .length = 64, .data = {}};
    constexpr std::uint8_t kRuns[] = {0x00, 0xFF, 0x0F, 0xF0, 0x87, 0x78, 0xC3, 0x1F};
    for (auto& byte : group.data) byte = kRuns[rng.Below(8)];
    const FdFrameBits bits = FrameBits(group);
    ASSERT_EQ(bits.nominal, kGroupBitsMax.nominal);
    ASSERT_LE(bits.data, kGroupBitsMax.data);
  }
  // ESI, DLC and data; a stuff bit before each fifth bit; stuff count, CRC, fixed stuff bits,
  // delimiter.
  static_assert(kGroupBitsMax.data == 1 + 4 + 512 + 516 / 4 + 4 + 21 + 7 + 1);
  // The pattern with the most stuff bits: four equal bits again and again.
  FdFrame worst{.id = kGroupId, .length = 64, .data = {}};
  worst.data.fill(0x87);
  EXPECT_GE(FrameBits(worst).data, kGroupBitsMax.data - 1);
  EXPECT_LE(FrameBits(worst).data, kGroupBitsMax.data);
}

TEST(FrameBits, AGroupCountsForItsTime) {
  constexpr FdFrameBits kBits{.nominal = 50, .data = 401};
  constexpr BusRates kRates{1'000'000, 4'000'000};
  EXPECT_EQ(NominalBits(kBits, kRates), 50u + 101u) << "rounded up";
  EXPECT_EQ(BitTime(kBits, kRates), (DurationNs{50'000 + 100'250}));
  EXPECT_EQ(LongestFrameBits({1'000'000, 0}), kFrameBitsMax);
  EXPECT_EQ(LongestFrameBits({1'000'000, 8'000'000}), kFrameBitsMax);
  EXPECT_EQ(LongestFrameBits({1'000'000, 2'000'000}), 53u + 340u);
}

TEST(FrameBits, OnTheWireTwoOrMoreGoTogetherAndOneAlone) {
  constexpr BusRates kClassic{1'000'000};
  constexpr BusRates kFd{1'000'000, 2'000'000};
  const CanFrame confirm = Encode(HostMessage(Confirm{MoveId{3}}), {NodeId{4}, 5});
  const CanFrame stop = Encode(HostMessage(Stop{}), {NodeId{4}, 5});
  const std::vector<CanFrame> frames{confirm, stop, confirm, confirm, confirm, stop};
  EXPECT_EQ(NextOnWire(frames, kFd).frames, 1u) << "one alone is no group";
  EXPECT_EQ(NextOnWire(frames, kFd).bits, FrameBits(confirm));
  const std::span<const CanFrame> from_third = std::span(frames).subspan(2);
  EXPECT_EQ(NextOnWire(from_third, kClassic).frames, 1u);
  const OnWire together = NextOnWire(from_third, kFd);
  EXPECT_EQ(together.frames, 3u);
  FdFrame group;
  ASSERT_EQ(PackGroup(from_third, &group), 3u);
  EXPECT_EQ(together.bits, NominalBits(FrameBits(group), kFd));
  const std::uint32_t alone = FrameBits(confirm) + 2 * FrameBits(stop);
  EXPECT_EQ(BitsOnWire(frames, kFd), alone + together.bits);
  EXPECT_EQ(BitsOnWire(frames, kClassic), alone + 3 * FrameBits(confirm));
  EXPECT_EQ(BitsOnWire({}, kFd), 0u);
}

TEST(FrameBits, IgnoresBytesBeyondTheLength) {
  CanFrame frame{0x123456, 2, {1, 2, 3, 4, 5, 6, 7, 8}};
  const std::uint32_t bits = FrameBits(frame);
  frame.data[2] = 0;
  EXPECT_EQ(FrameBits(frame), bits);
}

TEST(FrameBits, OneBitAtOneMegabitIsOneMicrosecond) {
  EXPECT_EQ(BitTime(1, 1'000'000), Microseconds(1));
  EXPECT_EQ(BitTime(160, 1'000'000), Microseconds(160));
  EXPECT_EQ(BitTime(160, 250'000), Microseconds(640));
}

}  // namespace
}  // namespace focalfleet
