#include "fleet/coordinate/bus_schedule.h"

#include <gtest/gtest.h>

#include "protocol/base/limits.h"
#include "protocol/wire/codec.h"
#include "protocol/wire/frame_bits.h"
#include "protocol/wire/stage_group.h"

namespace focalfleet {
namespace {

constexpr BusId kBus{3};
constexpr std::uint32_t kBitRate = 1'000'000;
constexpr HostInstant kNow{1'000'000'000};

CanFrame Frame(const HostMessage& message, std::uint8_t node = 1) {
  return Encode(message, {NodeId{node}, 1});
}

struct Released {
  std::vector<OutFrame> frames;
  std::vector<PositionerIndex> asked;
};
Released Release(BusSchedule* schedule, HostInstant now, DurationNs horizon = Milliseconds(4)) {
  Released released;
  schedule->Release(now, horizon, kBus, &released.frames, &released.asked);
  return released;
}

TEST(BusSchedule, UrgentFramesPassAllThatWait) {
  BusSchedule schedule({kBitRate});
  ASSERT_TRUE(schedule.Enqueue({Frame(StatusRequest{}), 0, {}}));
  ASSERT_TRUE(schedule.Enqueue({Frame(Confirm{{1}}), 0, {}}));
  ASSERT_TRUE(schedule.Enqueue({Frame(Stop{}), 0, {}}));
  const auto released = Release(&schedule, kNow);
  ASSERT_EQ(released.frames.size(), 3u);
  EXPECT_EQ(released.frames[0].frame, Frame(Stop{}));
  EXPECT_EQ(released.frames[1].frame, Frame(Confirm{{1}}));
}

TEST(BusSchedule, ReleasesNoMoreThanTheHorizonTakes) {
  BusSchedule schedule({kBitRate});
  const CanFrame frame = Frame(StageSegment{Axis::kPhi, 0, {100, 200, 108}});
  for (int n = 0; n < 500; ++n) ASSERT_TRUE(schedule.Enqueue({frame, 0, {}}));
  const DurationNs one = BitTime(FrameBits(frame), kBitRate);
  std::size_t sent = 0;
  HostInstant now = kNow;
  for (; schedule.waiting() != 0; now = schedule.ReadyAt(Milliseconds(4))) {
    const std::size_t batch = Release(&schedule, now).frames.size();
    EXPECT_LE(one * static_cast<std::int64_t>(batch), Milliseconds(4) + one);
    sent += batch;
  }
  EXPECT_EQ(sent, 500u);
  // The bus was kept busy: no longer than the frames take, and not faster than they fit.
  EXPECT_GE(now - kNow + Milliseconds(4), one * 499);
}

TEST(BusSchedule, HeldItReleasesNothingAndSaysWhenItWill) {
  BusSchedule schedule({kBitRate});
  ASSERT_TRUE(schedule.Enqueue({Frame(Stop{}), 0, {}}));
  schedule.Hold(kNow + Microseconds(640));
  schedule.Hold(kNow + Microseconds(100));  // no shorter
  EXPECT_TRUE(Release(&schedule, kNow).frames.empty());
  EXPECT_TRUE(Release(&schedule, kNow + Microseconds(639)).frames.empty());
  EXPECT_EQ(schedule.ReadyAt(Milliseconds(4)), kNow + Microseconds(640));
  EXPECT_EQ(Release(&schedule, kNow + Microseconds(640)).frames.size(), 1u);
  EXPECT_EQ(schedule.ReadyAt(Milliseconds(4)), kNever);
}

TEST(BusSchedule, ChargesTheAnswerWithTheQuestion) {
  BusSchedule with({kBitRate});
  BusSchedule without({kBitRate});
  for (int n = 0; n < 100; ++n) {
    ASSERT_TRUE(with.Enqueue({Frame(StatusRequest{}), 145, {}}));
    ASSERT_TRUE(without.Enqueue({Frame(StatusRequest{}), 0, {}}));
  }
  EXPECT_LT(Release(&with, kNow).frames.size(), Release(&without, kNow).frames.size() / 2 + 1);
}

TEST(BusSchedule, FullQueueRefusesAndTakesAgainWhenThereIsRoom) {
  BusSchedule schedule({kBitRate});
  for (std::uint32_t n = 0; n < limits::kFramesPerBusQueued; ++n)
    ASSERT_TRUE(schedule.Enqueue({Frame(StatusRequest{}), 0, {}}));
  EXPECT_FALSE(schedule.Enqueue({Frame(StatusRequest{}), 0, {}}));
  Release(&schedule, kNow);
  EXPECT_TRUE(schedule.Enqueue({Frame(StatusRequest{}), 0, {}}));
}

TEST(BusSchedule, DropForgetsOneNodeOnly) {
  BusSchedule schedule({kBitRate});
  for (const std::uint8_t node : std::initializer_list<std::uint8_t>{1, 2, 1, 3})
    ASSERT_TRUE(schedule.Enqueue({Frame(StatusRequest{}, node), 0, {}}));
  EXPECT_EQ(schedule.Drop(NodeId{1}), 2u);
  EXPECT_EQ(schedule.waiting(), 2u);
}

TEST(BusSchedule, NamesWhoseQuestionLeft) {
  BusSchedule schedule({kBitRate});
  ASSERT_TRUE(schedule.Enqueue({Frame(StatusRequest{}), 145, PositionerIndex{42}}));
  const auto released = Release(&schedule, kNow);
  ASSERT_EQ(released.asked.size(), 1u);
  EXPECT_EQ(released.asked[0].value, 42u);
  EXPECT_EQ(schedule.ReadyAt(Milliseconds(4)), kNever);
}

// Five entries of eleven bytes fill 55 of 64.
TEST(BusSchedule, LetsAGroupGoWholeAndChargesItsBits) {
  constexpr BusRates kRates{kBitRate, 5'000'000};
  BusSchedule schedule(kRates);
  constexpr std::uint32_t kAnswerBits = 100;
  const CanFrame frame = Frame(StageSegment{Axis::kPhi, 0, {100, 200, 108}});
  const std::vector<CanFrame> five(5, frame);
  for (int n = 0; n < 12; ++n)
    ASSERT_TRUE(schedule.Enqueue({frame, kAnswerBits, PositionerIndex{1}}));
  // Any room is room for a frame, and a group is one.
  const auto released = Release(&schedule, kNow, DurationNs{1});
  EXPECT_EQ(released.frames.size(), 5u);
  EXPECT_EQ(released.asked.size(), 5u);
  EXPECT_EQ(schedule.waiting(), 7u);
  FdFrame group;
  ASSERT_EQ(PackGroup(five, &group), 5u);
  const std::uint32_t bits = NominalBits(FrameBits(group), kRates) + 5 * kAnswerBits;
  EXPECT_EQ(schedule.ReadyAt(DurationNs{0}), kNow + BitTime(bits, kBitRate));
  EXPECT_LT(bits - 5 * kAnswerBits, 5 * FrameBits(frame) / 2);
}

TEST(BusSchedule, AFrameThatCannotBeGroupedEndsTheGroup) {
  constexpr BusRates kRates{kBitRate, 5'000'000};
  BusSchedule schedule(kRates);
  const CanFrame confirm = Frame(Confirm{{1}});
  // A broadcast's identifier, of the same priority.
  CanFrame broadcast = confirm;
  broadcast.id |= 255u << 11;
  for (const CanFrame& frame : {confirm, confirm, broadcast, confirm})
    ASSERT_TRUE(schedule.Enqueue({frame, 0, {}}));
  const auto first = Release(&schedule, kNow, DurationNs{1}).frames;
  ASSERT_EQ(first.size(), 2u);
  EXPECT_EQ(first[0].frame, confirm);
  EXPECT_EQ(first[1].frame, confirm);
  const HostInstant then = schedule.ReadyAt(DurationNs{0});
  EXPECT_EQ(Release(&schedule, then, DurationNs{1}).frames.size(), 1u);
  EXPECT_EQ(schedule.ReadyAt(DurationNs{0}), then + BitTime(FrameBits(broadcast), kBitRate));
}

}  // namespace
}  // namespace focalfleet
