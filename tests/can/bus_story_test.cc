#include "tests/can/bus_story.h"

#include <gtest/gtest.h>

#include <cstdio>
#include <string>

namespace focalfleet {
namespace {

using test::BusStory;
using test::CandumpLog;
using test::Listen;
using test::OverheardMove;
using test::OverheardUnit;
using test::ParseCandump;

std::string Line(const CanFrame& frame, const char* interface = "vcan0", int at_s = 1) {
  char head[80];
  std::snprintf(head, sizeof head, "(%d.000250) %s %08X#", at_s, interface, frame.id);
  std::string text = head;
  for (const std::uint8_t byte : frame.payload()) {
    char digits[3];
    std::snprintf(digits, sizeof digits, "%02X", byte);
    text += digits;
  }
  return text + "\n";
}

constexpr Address kUnit{{5}, 1};

std::string Host(const HostMessage& m) { return Line(Encode(m, kUnit)); }
std::string Unit(const UnitMessage& m) { return Line(Encode(m, kUnit)); }

BusStory Story(const std::string& text) { return Listen(ParseCandump(text).value()); }

TEST(CandumpLog, ReadsWhatCandumpWrites) {
  const auto log = ParseCandump(
      "(1436509052.249713) vcan12 1ABCDEF0#0011FE\n"
      "(1436509052.249714) can0 00000000#\n");
  ASSERT_TRUE(log);
  ASSERT_EQ(log->frames.size(), 2u);
  EXPECT_EQ(log->frames[0].at_us, 1436509052249713);
  EXPECT_EQ(log->frames[0].interface, "vcan12");
  EXPECT_EQ(log->frames[0].frame, (CanFrame{0x1ABCDEF0, 3, {0x00, 0x11, 0xFE}}));
  EXPECT_EQ(log->frames[1].frame, (CanFrame{}));
}

TEST(CandumpLog, CountsWhatIsNotOurs) {
  const auto log = ParseCandump(
      "(1.000000) vcan0 123#00\n"
      "(1.000000) vcan0 00000123#R\n"
      "(1.000000) vcan0 00000123##100\n"
      "(1.000000) vcan0 20000004#0000000000000000\n");
  ASSERT_TRUE(log);
  EXPECT_EQ(log->frames.size(), 0u);
  EXPECT_EQ(log->foreign, 4);
}

TEST(CandumpLog, RefusesWhatIsNoCandump) {
  for (const char* text :
       {"hello\n", "(1.0) vcan0 00000000#\n", "(1.000000) vcan0 00000000\n",
        "(1.000000) vcan0 00000000#0\n", "(1.000000) vcan0 00000000#001122334455667788\n",
        "(1.000000) vcan0 0000000G#\n", "1.000000 vcan0 00000000#\n"}) {
    const auto log = ParseCandump(std::string("(1.000000) vcan0 00000000#\n") + text);
    ASSERT_FALSE(log) << text;
    EXPECT_NE(log.error().text.find("line 2"), std::string::npos);
  }
}

TEST(BusStory, FollowsAMoveFromUploadToDone) {
  StagedMove staged{.move = {7}};
  staged.path[0].Append({10, 100, 108});
  staged.path[0].Append({500, -30, 108});
  staged.path[1].Append({0, 5, 37});
  const BusStory story =
      Story(Unit(IdentifyReply{{4711}}) + Unit(VectorReply{Axis::kTheta, 90, 96, -2}) +
            Unit(VectorReply{Axis::kPhi, 1, 96, 1}) + Host(StageBegin{{7}, {2, 1}, {}}) +
            Host(StageSegment{Axis::kTheta, 0, {10, 100, 108}}) +
            Host(StageSegment{Axis::kPhi, 0, {0, 5, 37}}) +
            Host(StageSegment{Axis::kTheta, 1, {500, -30, 108}}) +
            Host(StageSegment{Axis::kTheta, 1, {500, -30, 108}}) + Host(Confirm{{7}}) +
            Unit(ConfirmReply{{7}, Digest(staged), {2, 1}, Answer::kOk}) +
            Host(Arm{{7}, Digest(staged)}) + Unit(ArmReply{{7}, Answer::kOk}) +
            Line(Encode(HostMessage{Start{{7}, 0}}, {kBroadcastNode, 0}), "vcan0", 3) +
            Unit(Done{Outcome::kArrived, {-102 + 70, 97 + 5}, {7}}));
  EXPECT_TRUE(story.malformed.empty());
  ASSERT_EQ(story.units.size(), 1u);
  const OverheardUnit& unit = story.units.at({"vcan0", 5});
  EXPECT_EQ(unit.serial, SerialNumber{4711});
  const OverheardMove& move = unit.moves.at(7);
  EXPECT_EQ(Digest(move.staged), Digest(staged));
  EXPECT_EQ(move.confirmed_digest, Digest(staged));
  EXPECT_EQ(move.Way(), (std::array<std::int32_t, 2>{70, 5}));
  EXPECT_TRUE(move.armed);
  EXPECT_EQ(move.started_us, std::vector<std::int64_t>{3000250});
  EXPECT_EQ(unit.began_at.at(7)[0], -102);
  EXPECT_EQ(unit.began_at.at(7)[1], 97);
  EXPECT_EQ(move.done.value().position[0], -32);
}

TEST(BusStory, AStartReachesOnlyArmedUnitsOfItsOwnBus) {
  const auto begin = Host(StageBegin{{7}, {0, 0}, {}}) + Host(Confirm{{7}});
  const auto armed = begin + Unit(ArmReply{{7}, Answer::kOk});
  const auto start = [](const char* interface, std::uint16_t move) {
    return Line(Encode(HostMessage{Start{{move}, 0}}, {kBroadcastNode, 0}), interface);
  };
  const auto starts = [](const BusStory& story) {
    return story.units.at({"vcan0", 5}).moves.at(7).started_us.size();
  };
  EXPECT_EQ(starts(Story(begin + start("vcan0", 7))), 0u);
  EXPECT_EQ(starts(Story(armed + start("vcan1", 7))), 0u);
  EXPECT_EQ(starts(Story(armed + start("vcan0", 8))), 0u);
  EXPECT_EQ(starts(Story(armed + start("vcan0", 7))), 1u);
}

TEST(BusStory, NamesWhatNoDecoderTakes) {
  CanFrame bad = Encode(UnitMessage{StatusReply{}}, kUnit);
  bad.data[2] = 0x80;
  const BusStory story = Story(Line(bad));
  ASSERT_EQ(story.malformed.size(), 1u);
  EXPECT_NE(story.malformed[0].find("reserved"), std::string::npos);
}

}  // namespace
}  // namespace focalfleet
