#include "protocol/wire/staged_move.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "protocol/base/rng.h"
#include "tests/support/alloc_guard.h"

namespace focalfleet {
namespace {

// CRC-32 (IEEE 802.3) bit by bit, most significant bit first on reflected bytes. The derivation
// differs from the table-driven one under test.
std::uint32_t Reflected(std::uint32_t value, int count) {
  std::uint32_t out = 0;
  for (int i = 0; i < count; ++i) out |= (value >> i & 1) << (count - 1 - i);
  return out;
}
std::uint32_t Crc32(const std::vector<std::uint8_t>& bytes) {
  std::uint32_t crc = 0xffffffff;
  for (const std::uint8_t byte : bytes) {
    crc ^= Reflected(byte, 8) << 24;
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 0x80000000) != 0 ? crc << 1 ^ 0x04c11db7 : crc << 1;
  }
  return ~Reflected(crc, 32);
}

std::vector<std::uint8_t> Bytes(const StagedMove& move) {
  std::vector<std::uint8_t> out;
  const auto put = [&](std::uint32_t value, int count) {
    for (int i = 0; i < count; ++i) out.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  };
  put(move.move.value, 2);
  put(move.path[0].size(), 1);
  put(move.path[1].size(), 1);
  put(static_cast<std::uint32_t>(move.mode), 1);
  for (const AxisPath& path : move.path) {
    std::uint32_t index = 0;
    for (const Segment& segment : path.segments()) {
      put(index++, 1);
      put(segment.start_ticks, 3);
      put(static_cast<std::uint32_t>(segment.delta), 3);
      put(segment.repeat, 1);
    }
  }
  return out;
}

StagedMove RandomMove(Rng& rng) {
  StagedMove move;
  move.move = {static_cast<std::uint16_t>(1 + rng.Below(65535))};
  move.mode = static_cast<WaveMode>(rng.Below(3));
  for (AxisPath& path : move.path) {
    for (auto left = rng.Below(limits::kSegmentsPerAxis + 1); left > 0; --left) {
      path.Append({static_cast<std::uint32_t>(rng.Below(1u << 24)),
                   static_cast<std::int32_t>(rng.Below(1u << 24)) - (1 << 23),
                   static_cast<std::uint8_t>(1 + rng.Below(255))});
    }
  }
  return move;
}

TEST(Digest, TheOraclesCrcIsThePublishedOne) {
  EXPECT_EQ(Crc32({'1', '2', '3', '4', '5', '6', '7', '8', '9'}), 0xCBF43926u);
}

TEST(Digest, IsTheCrcOfTheDocumentedBytes) {
  Rng rng(21);
  for (int i = 0; i < 2000; ++i) {
    const StagedMove move = RandomMove(rng);
    ASSERT_EQ(Digest(move), Crc32(Bytes(move)));
  }
}

TEST(Digest, ChangesWithEveryField) {
  Rng rng(22);
  for (int i = 0; i < 500; ++i) {
    StagedMove move = RandomMove(rng);
    const std::uint32_t before = Digest(move);
    StagedMove other = move;
    other.move.value = static_cast<std::uint16_t>(other.move.value ^ 1u << rng.Below(16));
    EXPECT_NE(Digest(other), before);
    if (!move.path[1].full()) {
      other = move;
      other.path[1].Append({0, 0, 1});
      EXPECT_NE(Digest(other), before);
    }
    other = move;
    std::swap(other.path[0], other.path[1]);
    if (Bytes(other) != Bytes(move)) {
      EXPECT_NE(Digest(other), before);
    }
  }
}

TEST(Digest, UsesNoHeap) {
  Rng rng(23);
  const StagedMove move = RandomMove(rng);
  const test::AllocGuard guard;
  const std::uint32_t digest = Digest(move);
  EXPECT_EQ(guard.allocations(), 0u) << digest;
}

TEST(AxisPath, HoldsFifteenSegmentsInOrder) {
  AxisPath path;
  for (std::uint32_t i = 0; i < limits::kSegmentsPerAxis; ++i) {
    EXPECT_FALSE(path.full());
    path.Append({i, 0, 1});
  }
  EXPECT_TRUE(path.full());
  ASSERT_EQ(path.segments().size(), limits::kSegmentsPerAxis);
  for (std::uint32_t i = 0; i < limits::kSegmentsPerAxis; ++i)
    EXPECT_EQ(path.segments()[i].start_ticks, i);
  EXPECT_DEATH(path.Append({}), "check failed");
}

}  // namespace
}  // namespace focalfleet
