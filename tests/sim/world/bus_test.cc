#include "sim/world/bus/bus.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/wire/codec.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

CanFrame FrameOf(std::uint32_t id, std::uint8_t length = 0, std::uint8_t fill = 0) {
  CanFrame frame{id, length, {}};
  std::fill_n(frame.data.begin(), length, fill);
  return frame;
}

/// A bus with eight units: nodes 1..8.
Bus BusOfEight(const BusOptions& options, Rng chance = Rng(1)) {
  Bus bus(options, chance);
  for (int i = 0; i < 8; ++i) bus.Attach();
  return bus;
}

std::vector<Bus::Heard> Drain(Bus* bus, HostInstant until = {INT64_MAX - 1}) {
  std::vector<Bus::Heard> all;
  while (bus->NextEvent() <= until) {
    Bus::Heard heard;
    if (bus->Advance(&heard)) all.push_back(heard);
  }
  return all;
}

// The bits of an extended frame without stuff bits, by the standard's fields, and stuff bits
// counted on a string.
std::uint32_t BitsByHand(const CanFrame& frame) {
  std::string bits;
  const auto add = [&](std::uint32_t value, int count) {
    for (int i = count - 1; i >= 0; --i) bits += (value >> i & 1) != 0 ? '1' : '0';
  };
  add(0, 1);
  add(frame.id >> 18, 11);
  bits += "11";
  add(frame.id, 18);
  bits += "000";
  add(frame.length, 4);
  for (int i = 0; i < frame.length; ++i) add(frame.data[static_cast<std::size_t>(i)], 8);
  // The CRC comes from long division.
  std::string dividend = bits + std::string(15, '0');
  const std::string divisor = "1100010110011001";
  for (std::size_t i = 0; i + 15 < dividend.size(); ++i)
    if (dividend[i] == '1')
      for (std::size_t j = 0; j < 16; ++j)
        dividend[i + j] = dividend[i + j] == divisor[j] ? '0' : '1';
  bits += dividend.substr(dividend.size() - 15);
  std::string stuffed;
  for (const char bit : bits) {
    stuffed += bit;
    if (stuffed.size() >= 5 && stuffed.substr(stuffed.size() - 5) == std::string(5, bit))
      stuffed += bit == '1' ? '0' : '1';
  }
  return static_cast<std::uint32_t>(stuffed.size()) + 13;
}

TEST(Bus, HoldsTheWireForExactlyTheFramesBits) {
  const std::uint64_t seed = focalfleet::test::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  Bus bus = BusOfEight({.bit_rate_bps = 1'000'000}, Rng(1));
  std::int64_t end_ns = 0;
  std::uint64_t bits = 0;
  for (int i = 0; i < 500; ++i) {
    CanFrame frame = FrameOf(static_cast<std::uint32_t>(rng.Below(1u << 29)),
                             static_cast<std::uint8_t>(rng.Below(9)));
    for (int k = 0; k < frame.length; ++k)
      frame.data[static_cast<std::size_t>(k)] =
          static_cast<std::uint8_t>(rng.Below(2) != 0 ? 0 : rng.Below(256));
    ASSERT_TRUE(bus.Offer({frame, false, 0}, {end_ns}));
    const auto heard = Drain(&bus);
    ASSERT_EQ(heard.size(), 1u);
    end_ns += BitsByHand(frame) * 1000;
    bits += BitsByHand(frame);
    EXPECT_EQ(heard[0].at.ns, end_ns);
    EXPECT_EQ(heard[0].sent.frame, frame);
  }
  EXPECT_EQ(bus.counters().wire.bits, bits);
  EXPECT_EQ(bus.counters().wire.busy.ns, end_ns);
  EXPECT_DOUBLE_EQ(bus.counters().wire.Load({2 * end_ns}), 0.5);
}

TEST(Bus, SlowerBitsTakeLonger) {
  Bus bus = BusOfEight({.bit_rate_bps = 250'000}, Rng(1));
  const CanFrame frame = FrameOf(0x123, 8, 0x55);
  bus.Offer({frame, false, 0}, {100});
  EXPECT_EQ(Drain(&bus)[0].at.ns, 100 + BitsByHand(frame) * 4000);
}

TEST(Bus, LowestIdentifierWinsAmongAllThatWait) {
  Bus bus = BusOfEight({}, Rng(1));
  const std::uint32_t ids[] = {700, 20, 500, 20, 90, 3};
  std::uint32_t sender = 1;
  for (const std::uint32_t id : ids) bus.Offer({FrameOf(id), true, sender++}, {0});
  const auto heard = Drain(&bus);
  ASSERT_EQ(heard.size(), 6u);
  const std::uint32_t senders[] = {6, 2, 4, 5, 3, 1};  // equal identifiers in order of coming
  for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(heard[i].sent.sender, senders[i]);
  EXPECT_EQ(bus.counters().mailboxes.waiting_max, 6u);
}

TEST(Bus, AFrameOnTheWireIsNotInterrupted) {
  Bus bus = BusOfEight({}, Rng(1));
  const CanFrame low = FrameOf(0x1fffffff, 8, 0xff);
  bus.Offer({low, true, 1}, {0});
  bus.Offer({FrameOf(9), true, 2}, {10'000});
  bus.Offer({FrameOf(1), true, 3}, {20'000});
  const auto heard = Drain(&bus);
  ASSERT_EQ(heard.size(), 3u);
  EXPECT_EQ(heard[0].sent.sender, 1u);
  EXPECT_EQ(heard[0].at.ns, BitsByHand(low) * 1000);
  EXPECT_EQ(heard[1].sent.sender, 3u);
  EXPECT_EQ(heard[2].sent.sender, 2u);
}

TEST(Bus, RefusesWhatItHasNoMailboxFor) {
  Bus bus = BusOfEight({.mailboxes_max = 3}, Rng(1));
  for (std::uint32_t i = 0; i < 3; ++i) EXPECT_TRUE(bus.Offer({FrameOf(i), false, 0}, {0}));
  EXPECT_FALSE(bus.Offer({FrameOf(9), false, 0}, {0}));
  EXPECT_EQ(bus.counters().mailboxes.refused, 1u);
  EXPECT_EQ(Drain(&bus).size(), 3u);
  EXPECT_TRUE(bus.Offer({FrameOf(9), false, 0}, {0}));
}

TEST(Bus, ADeadBusLosesWhatWaitsAndCarriesAgainWhenRevived) {
  Bus bus = BusOfEight({}, Rng(1));
  bus.Offer({FrameOf(1), false, 0}, {0});
  bus.Offer({FrameOf(2), false, 0}, {0});
  bus.disturb().Kill({0});
  EXPECT_EQ(bus.NextEvent(), kNever);
  EXPECT_FALSE(bus.Offer({FrameOf(3), false, 0}, {0}));
  EXPECT_EQ(bus.counters().mailboxes.dropped, 3u);
  bus.disturb().Revive({0});
  EXPECT_TRUE(bus.Offer({FrameOf(4), false, 0}, {0}));
  EXPECT_EQ(Drain(&bus).size(), 1u);
}

TEST(Bus, PlantedChanceDropsDuplicatesAndDelaysAtItsRate) {
  const std::uint64_t seed = focalfleet::test::TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Bus bus = BusOfEight({}, Rng(seed));
  bus.faults() = {.drop = 0.1, .duplicate = 0.05, .late = 0.3, .late_by = Milliseconds(5)};
  int heard_count = 0;
  int lost = 0;
  int late = 0;
  constexpr int kFrames = 10'000;
  for (int i = 0; i < kFrames; ++i) {
    const HostInstant at{i * 10'000'000ll};
    bus.Offer({FrameOf(5), false, 0}, at);
    for (const Bus::Heard& heard : Drain(&bus)) {
      ++heard_count;
      lost += heard.lost ? 1 : 0;
      late += (heard.at - at).ns > 5'000'000 ? 1 : 0;
    }
  }
  // A frame that is sent again may be received twice again: 1 / (1 - 0.05) times. The bound is five
  // standard deviations.
  EXPECT_NEAR(heard_count, kFrames * 1.0526, 5 * 24);
  EXPECT_NEAR(lost, kFrames * 0.10526, 5 * 32);
  EXPECT_NEAR(late, kFrames * 0.3158, 5 * 50);
  EXPECT_EQ(bus.counters().received_twice, heard_count - kFrames);
}

TEST(Bus, WithoutABitClockFramesPassAtOnceInOrder) {
  Bus bus = BusOfEight({.bit_clock = false}, Rng(1));
  bus.Offer({FrameOf(7), false, 0}, {5});
  bus.Offer({FrameOf(2), false, 0}, {9});
  const auto heard = Drain(&bus);
  ASSERT_EQ(heard.size(), 2u);
  EXPECT_EQ(heard[0].at.ns, 5);
  EXPECT_EQ(heard[1].at.ns, 9);
}

}  // namespace
}  // namespace focalfleet::sim
