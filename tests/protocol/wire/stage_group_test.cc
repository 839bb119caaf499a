#include "protocol/wire/stage_group.h"

#include <gtest/gtest.h>

#include <vector>

#include "protocol/base/rng.h"
#include "protocol/wire/staged_move.h"
#include "tests/protocol/random_messages.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

CanFrame Groupable(Rng& rng) {
  for (;;) {
    const CanFrame frame = Encode(
        test::RandomHost(rng),
        {{static_cast<std::uint8_t>(rng.Below(128))}, static_cast<std::uint8_t>(rng.Below(256))});
    if (CanBeGrouped(frame)) return frame;
  }
}

TEST(StageGroup, IsTheBytesOfThePage) {
  // The example of docs/protocol.md, "CAN FD", worked out by hand.
  const CanFrame begin =
      Encode(StageBegin{MoveId{0x0201}, {1, 2}, WaveMode::kFiveSegment}, {NodeId{7}, 0});
  const CanFrame confirm = Encode(Confirm{MoveId{0x0201}}, {NodeId{7}, 9});
  const std::vector<CanFrame> frames{begin, confirm};
  FdFrame group;
  ASSERT_EQ(PackGroup(frames, &group), 2u);
  EXPECT_EQ(group.id, 0x1107f800u);
  const FdFrame expected{.id = 0x1107f800u,
                         .length = 16,
                         .data = {7, 0, 0x28, 0x01, 0x02, 1, 2, 1,  //
                                  7, 9, 0x38, 0x01, 0x02, 0xff, 0xff, 0xff}};
  EXPECT_EQ(group, expected);
}

TEST(StageGroup, GivesBackWhatWasPutIn) {
  const auto seed = test::TestSeed(31);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int round = 0; round < 5000; ++round) {
    std::vector<CanFrame> frames(1 + rng.Below(20));
    for (CanFrame& frame : frames) frame = Groupable(rng);
    FdFrame group;
    const std::size_t taken = PackGroup(frames, &group);
    ASSERT_GE(taken, 1u);
    const auto entries = UnpackGroup(group);
    ASSERT_TRUE(entries.has_value()) << Name(entries.error());
    ASSERT_EQ(entries->count, taken);
    for (std::size_t i = 0; i < taken; ++i) ASSERT_EQ(entries->frame[i], frames[i]) << i;
    // The next frame would not have fitted.
    std::size_t size = 0;
    for (std::size_t i = 0; i < taken; ++i) size += GroupedSize(frames[i]);
    if (taken < frames.size()) {
      ASSERT_GT(size + GroupedSize(frames[taken]), 64u);
    }
  }
}

TEST(StageGroup, CarriesOnlyAHostsStagingToOneUnit) {
  Rng rng(32);
  for (int i = 0; i < 20'000; ++i) {
    const HostMessage message = test::RandomHost(rng);
    const NodeId node{static_cast<std::uint8_t>(rng.Below(2) == 0 ? rng.Below(128) : 255)};
    const bool staging = std::holds_alternative<StageBegin>(message) ||
                         std::holds_alternative<StageSegment>(message) ||
                         std::holds_alternative<Confirm>(message);
    ASSERT_EQ(CanBeGrouped(Encode(message, {node, 1})), staging && node != kBroadcastNode);
    const CanFrame answer = Encode(test::RandomUnit(rng), {{3}, 1});
    ASSERT_FALSE(CanBeGrouped(answer));
    FdFrame group;
    ASSERT_EQ(PackGroup({&answer, 1}, &group), 0u);
  }
}

TEST(StageGroup, HoldsAllOfTwoUnitsWithOneSegmentAnAxis) {
  std::vector<CanFrame> frames;
  for (std::uint8_t node = 0; node < 2; ++node) {
    frames.push_back(Encode(StageBegin{MoveId{1}, {1, 0}, {}}, {NodeId{node}, 0}));
    frames.push_back(Encode(StageSegment{Axis::kTheta, 0, {0, 100, 37}}, {NodeId{node}, 0}));
    frames.push_back(Encode(Confirm{MoveId{1}}, {NodeId{node}, 5}));
  }
  FdFrame group;
  EXPECT_EQ(PackGroup(frames, &group), 6u);
  EXPECT_EQ(group.length, 48);
}

TEST(StageGroup, DropsTheWholeGroupForOneWrongByte) {
  std::vector<CanFrame> frames{Encode(StageBegin{MoveId{1}, {1, 1}, {}}, {NodeId{1}, 0}),
                               Encode(Confirm{MoveId{1}}, {NodeId{1}, 5})};
  FdFrame group;
  ASSERT_EQ(PackGroup(frames, &group), 2u);  // 13 bytes used of 16
  const auto broken = [&](auto change) {
    FdFrame other = group;
    change(other);
    const auto entries = UnpackGroup(other);
    return entries ? "well" : Name(entries.error());
  };
  EXPECT_STREQ(broken([](FdFrame&) {}), "well");
  EXPECT_STREQ(broken([](FdFrame& f) { f.id |= 1u << 29; }), Name(Malformed::kIdentifier));
  EXPECT_STREQ(broken([](FdFrame& f) { f.id ^= 1u << 26; }), Name(Malformed::kFunction));
  EXPECT_STREQ(broken([](FdFrame& f) { f.id ^= 1u << 20; }), Name(Malformed::kFunction));
  EXPECT_STREQ(broken([](FdFrame& f) { f.id ^= 1u << 11; }), Name(Malformed::kReserved));
  EXPECT_STREQ(broken([](FdFrame& f) { f.id ^= 1; }), Name(Malformed::kReserved));
  EXPECT_STREQ(broken([](FdFrame& f) { f.length = 15; }), Name(Malformed::kLength));
  EXPECT_STREQ(broken([](FdFrame& f) { f.length = 12; }), Name(Malformed::kLength));
  EXPECT_STREQ(broken([](FdFrame& f) { f.length = 65; }), Name(Malformed::kLength));
  EXPECT_STREQ(broken([](FdFrame& f) { f.length = 0; }), Name(Malformed::kReserved));
  EXPECT_STREQ(broken([](FdFrame& f) { f.data[0] = 128; }), Name(Malformed::kNode));
  EXPECT_STREQ(broken([](FdFrame& f) { f.data[2] = 4 << 3; }), Name(Malformed::kFunction));
  EXPECT_STREQ(broken([](FdFrame& f) { f.data[15] = 0; }), Name(Malformed::kReserved));
  EXPECT_STREQ(broken([](FdFrame& f) { f.data[8] = 0xff; }), Name(Malformed::kReserved));
  // The data are longer than the entries need.
  EXPECT_STREQ(broken([](FdFrame& f) {
                 f.length = 20;
                 for (std::size_t i = 16; i < 20; ++i) f.data[i] = 0xff;
               }),
               Name(Malformed::kLength));
}

// The group is well formed, but one entry is no message: no unit takes any of it.
TEST(StageGroup, AnEntryThatNoUnitWouldTakeDropsItAll) {
  const std::vector<CanFrame> frames{Encode(StageBegin{MoveId{1}, {1, 1}, {}}, {NodeId{1}, 0}),
                                     Encode(Confirm{MoveId{1}}, {NodeId{2}, 5})};
  FdFrame group;
  ASSERT_EQ(PackGroup(frames, &group), 2u);
  ASSERT_TRUE(UnpackGroup(group));
  group.data[2] |= 5;  // stage_begin has no detail
  const auto wrong = DecodeHost({.id = frames[0].id | 5, .length = 5, .data = frames[0].data});
  ASSERT_FALSE(wrong);
  const auto entries = UnpackGroup(group);
  ASSERT_FALSE(entries);
  EXPECT_EQ(entries.error(), wrong.error());
}

}  // namespace
}  // namespace focalfleet
