// Parameters written to units of the in-process fleet, positions among them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <variant>
#include <vector>

#include "protocol/wire/codec.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"

namespace focalfleet {
namespace {

using test::ExpectOthersArrive;
using test::ExpectStoreTellsTheTruth;
using test::HasAlarm;
using test::InProcessFleet;
using test::RunIntoMotion;
using test::Small;
using test::SomebodyMoving;
using test::TruePoses;

ReplyEffect Write(InProcessFleet* fleet, const WriteParameterCommand& command) {
  static std::uint64_t request = 5000;
  fleet->Send({++request, command});
  EXPECT_TRUE(fleet->RunUntil([&] { return fleet->LastReply(request).has_value(); }, Seconds(60)));
  fleet->Run(Seconds(1));
  return fleet->LastReply(request).value_or(ReplyEffect{});
}

TEST(Configuration, ParameterIsSetWhenTheUnitSaysSo) {
  InProcessFleet fleet(Small(43));
  fleet.Run(Seconds(5));
  EXPECT_EQ(Write(&fleet, {{3}, Axis::kTheta, Parameter::kRepeat, 54}).text,
            "unit 4: theta repeat = 54");
  EXPECT_EQ(fleet.coordinator().drives()[3].axis[0].repeat, 54);
  const auto refused = Write(&fleet, {{3}, Axis::kTheta, Parameter::kRepeat, 0});
  ASSERT_TRUE(refused.error);
  EXPECT_EQ(refused.error->code, ErrorCode::kRefused);
  EXPECT_EQ(refused.error->text, "unit 4 refuses it (bad_value): theta repeat stays 54");
  EXPECT_EQ(Write(&fleet, {{3}, Axis::kPhi, Parameter::kSubdivision, 192}).text,
            "unit 4: phi subdivision = 192");
  EXPECT_EQ(fleet.coordinator().drives()[3].axis[1].subdivision, 192);
  EXPECT_FALSE(IsPlace(fleet.coordinator().unit({3}).knowledge)) << "rounded: not the same place";
  fleet.world().disturb().faults(fleet.id(3))->silent = true;
  const auto silent = Write(&fleet, {{3}, Axis::kTheta, Parameter::kRepeat, 60});
  ASSERT_TRUE(silent.error);
  EXPECT_EQ(silent.error->code, ErrorCode::kUnavailable);
  EXPECT_EQ(silent.error->text, "unit 4 did not answer: it may have taken the value or not");
}

// A unit restarted in mid-move, and the store cannot take what follows.
TEST(Configuration, ParameterOfAUnitThatIsNotResumedYetWaitsForTheStore) {
  InProcessFleet fleet(Small(45));
  fleet.ApplyRandom(45);
  RunIntoMotion(&fleet, Seconds(1));
  const PositionerIndex i = SomebodyMoving(&fleet);
  fleet.world().disturb().PowerCut(fleet.id(i.value));
  fleet.Restart();
  fleet.storage.fails = true;
  fleet.world().disturb().PowerOn(fleet.id(i.value));
  fleet.Run(Seconds(2));
  ASSERT_EQ(fleet.coordinator().unit(i).phase, UnitPhase::kIdentifying);
  fleet.Send({7000, WriteParameterCommand{i, Axis::kTheta, Parameter::kRepeat, 54}});
  fleet.Run(Seconds(1));
  EXPECT_FALSE(fleet.LastReply(7000));
  fleet.storage.fails = false;
  fleet.Run(Seconds(3));
  ASSERT_TRUE(fleet.LastReply(7000));
  EXPECT_THAT(fleet.LastReply(7000)->text, testing::HasSubstr("theta repeat = 54"));
}

// The daemon was away for longer than units wait for a host, and moves were open.
TEST(Configuration, AUnitThatLostTheHostInMidMoveIsResumedAndTakesSettings) {
  InProcessFleet fleet(Small(45));
  fleet.ApplyRandom(45);
  RunIntoMotion(&fleet, Seconds(1));
  fleet.Freeze(Seconds(60), InProcessFleet::Heard::kLost);
  fleet.Restart();
  fleet.Run(Seconds(5));
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n)
    EXPECT_EQ(fleet.coordinator().unit({n}).phase, UnitPhase::kReady) << n;
  EXPECT_EQ(Write(&fleet, {{3}, Axis::kTheta, Parameter::kRepeat, 54}).text,
            "unit 4: theta repeat = 54");
  EXPECT_FALSE(HasAlarm(fleet, "refuses"));
}

TEST(Configuration, ParameterIsTakenAfterTheQuestionThatIsOpen) {
  InProcessFleet fleet(Small(44));
  fleet.Run(Seconds(5));
  // The poll of each unit at rest comes within these seconds; every step sends a parameter, so that
  // some of them meet the question.
  std::vector<OutFrame> sent;
  fleet.sent = &sent;
  const auto polled = [&] {
    return std::ranges::any_of(sent, [&](const OutFrame& out) {
      const auto frame = DecodeHost(out.frame);
      return out.bus == fleet.layout().unit({3}).bus && frame &&
             frame->address.node == fleet.layout().unit({3}).node &&
             std::holds_alternative<StatusRequest>(frame->message);
    });
  };
  ASSERT_TRUE(fleet.RunUntil(polled, Seconds(60)));
  for (const Axis axis : kAxes)
    fleet.Send({7000 + Index(axis), WriteParameterCommand{{3}, axis, Parameter::kRepeat, 54}});
  fleet.Run(Seconds(1));
  for (const Axis axis : kAxes) {
    const auto reply = fleet.LastReply(7000 + Index(axis));
    ASSERT_TRUE(reply);
    EXPECT_FALSE(reply->error) << reply->error->text;
    EXPECT_EQ(fleet.coordinator().drives()[3].axis[Index(axis)].repeat, 54);
  }
}

TEST(Configuration, ParametersWaitUntilTheUnitIsReadAgain) {
  InProcessFleet fleet(Small(45));
  fleet.Run(Seconds(5));
  // The unit is read anew after the first.
  fleet.Send({7000, WriteParameterCommand{{3}, Axis::kTheta, Parameter::kSubdivision, 192}});
  fleet.Send({7001, WriteParameterCommand{{3}, Axis::kPhi, Parameter::kSubdivision, 192}});
  fleet.Send({7002, WriteParameterCommand{{3}, Axis::kPhi, Parameter::kRepeat, 54}});
  fleet.Run(Seconds(2));
  for (const std::uint64_t request : {7000u, 7001u, 7002u}) {
    const auto reply = fleet.LastReply(request);
    ASSERT_TRUE(reply) << request;
    EXPECT_FALSE(reply->error) << reply->error->text;
  }
  EXPECT_EQ(fleet.coordinator().drives()[3].axis[1].subdivision, 192);
  EXPECT_EQ(fleet.coordinator().drives()[3].axis[1].repeat, 54);
}

TEST(Configuration, ParametersThatWaitForASilentUnitAreRefused) {
  InProcessFleet fleet(Small(46));
  fleet.Run(Seconds(5));
  fleet.world().disturb().faults(fleet.id(3))->silent = true;
  for (std::uint64_t request = 7000; request < 7070; ++request)
    fleet.Send({request, WriteParameterCommand{{3}, Axis::kTheta, Parameter::kRepeat, 54}});
  fleet.Run(Seconds(10));
  const auto error = [&](std::uint64_t request) {
    const auto reply = fleet.LastReply(request);
    return reply && reply->error ? reply->error->text : "none";
  };
  EXPECT_EQ(error(7000), "unit 4 did not answer: it may have taken the value or not");
  EXPECT_EQ(error(7001), "unit 4 takes parameters only at rest; its phase is silent");
  EXPECT_EQ(error(7069), "unit 4 has 64 parameters to write already; go on when they are answered");
}

TEST(Configuration, PlansWaitForAParameterThatIsBeingWritten) {
  InProcessFleet fleet(Small(47));
  fleet.Run(Seconds(5));
  fleet.Send({7000, WriteParameterCommand{{3}, Axis::kTheta, Parameter::kRepeat, 54}});
  fleet.Send({7001, WriteParameterCommand{{3}, Axis::kPhi, Parameter::kRepeat, 54}});
  fleet.ApplyRandom(47);
  const auto planned = [&] { return fleet.coordinator().configuration().round == 1; };
  ASSERT_TRUE(fleet.RunUntil(planned, Seconds(10)));
  for (const Axis axis : kAxes)
    EXPECT_EQ(fleet.coordinator().drives()[3].axis[Index(axis)].repeat, 54);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Configuration, WritingItsPositionMakesAUnitKnown) {
  InProcessFleet fleet(Small(22));
  fleet.ApplyRandom(22);
  RunIntoMotion(&fleet, Seconds(2));
  const PositionerIndex one = SomebodyMoving(&fleet);
  fleet.world().disturb().PowerCut(fleet.id(one.value));
  fleet.Run(Seconds(3));
  fleet.world().disturb().PowerOn(fleet.id(one.value));
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.Run(Seconds(15));
  const UnitView& view = fleet.coordinator().unit(one);
  ASSERT_FALSE(IsPlace(view.knowledge));
  // The unit takes the nearest position that shows its vector, and the store records that position.
  const Pose seen = TruePoses(fleet)[one.value];
  for (const Axis axis : kAxes) {
    const auto reply = Write(&fleet, {one, axis, Parameter::kPosition, seen[Index(axis)] + 7});
    EXPECT_FALSE(reply.error);
    EXPECT_NE(reply.text.find("position = "), std::string::npos) << reply.text;
  }
  EXPECT_TRUE(IsPlace(view.knowledge));
  ExpectStoreTellsTheTruth(fleet, "after it was written");
  fleet.Restart();
  fleet.Run(Seconds(5));
  EXPECT_TRUE(IsPlace(fleet.coordinator().unit(one).knowledge)) << "and after a restart";
  fleet.ApplyRandom(22);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

}  // namespace
}  // namespace focalfleet
