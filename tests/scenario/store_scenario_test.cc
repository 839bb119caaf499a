// A store that is late, fails or refuses rows, under the in-process fleet. A motion begins, and a
// command is reported as done, only after its row is durable.
#include <gtest/gtest.h>

#include <string>

#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::ExpectOthersArrive;
using test::HasAlarm;
using test::InProcessFleet;
using test::Small;

TEST(Configuration, NothingStartsBeforeTheIntentIsDurable) {
  auto options = Small(6);
  options.commit_delay = Seconds(3);
  InProcessFleet fleet(options);
  fleet.ApplyRandom(6);
  ASSERT_TRUE(fleet.RunUntil(
      [&] {
        for (std::size_t n = 0; n < fleet.layout().size(); ++n)
          if (fleet.world().Truth(n).moves_begun != 0) return true;
        return false;
      },
      Seconds(120)));
  EXPECT_EQ(fleet.store().begun.size(), fleet.store().fleet.open_intents.size());
  EXPECT_GE(fleet.store().begun.size(), 30u);
}

TEST(Configuration, FailingStoreStartsNothingAndRefusesTheNext) {
  InProcessFleet fleet(Small(7));
  fleet.Run(Seconds(5));
  fleet.ApplyRandom(7);
  fleet.Run(Milliseconds(25));
  fleet.storage.fails = true;
  fleet.Run(Seconds(30));
  for (std::size_t n = 0; n < fleet.layout().size(); ++n)
    EXPECT_EQ(fleet.world().Truth(n).moves_begun, 0u);
  EXPECT_EQ(fleet.coordinator().configuration().state, ConfigurationState::kUploading);
  EXPECT_EQ(fleet.coordinator().configuration().waiting_for, "the store, which cannot be written");
  fleet.storage.fails = false;
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().configuration().waiting_for, "");
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
  fleet.storage.fails = true;
  const auto refused = fleet.ApplyRandom(8);
  fleet.Run(Seconds(1));
  ASSERT_TRUE(fleet.LastReply(refused));
  EXPECT_TRUE(fleet.LastReply(refused)->error);
}

TEST(Configuration, APlannerThatFailsEndsItAndTheNextOneGoes) {
  InProcessFleet fleet(Small(46));
  fleet.Run(Seconds(3));
  fleet.planner.fails = true;
  const auto request = fleet.ApplyRandom(46);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().configuration().state, ConfigurationState::kFailed);
  ASSERT_TRUE(fleet.LastReply(request));
  ASSERT_TRUE(fleet.LastReply(request)->error);
  EXPECT_NE(fleet.LastReply(request)->error->text.find("no memory"), std::string::npos);
  fleet.planner.fails = false;
  fleet.ApplyRandom(47);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
}

TEST(Configuration, ARowThatTheStoreRefusesTakesItsUnitAloneOut) {
  InProcessFleet fleet(Small(45));
  fleet.Run(Seconds(3));
  fleet.storage.refuse = [](const Row& row) {
    const auto* intent = std::get_if<IntentRow>(&row);
    return intent != nullptr && intent->unit == UnitId{8};
  };
  fleet.ApplyRandom(45);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.world().Truth(std::size_t{7}).moves_begun, 0u) << "without a durable intent";
  EXPECT_EQ(fleet.coordinator().unit({7}).phase, UnitPhase::kFault);
  EXPECT_TRUE(HasAlarm(fleet, "the store refuses the intent of serial"));
  ExpectOthersArrive(&fleet, 4);
  // The unit stays out until an operator reports that it is repaired.
  fleet.storage.refuse = nullptr;
  fleet.Run(Seconds(30));
  EXPECT_EQ(fleet.coordinator().unit({7}).phase, UnitPhase::kFault);
  fleet.Send({900, EnableCommand{{{7}}, true, {}}});
  fleet.Run(Seconds(5));
  EXPECT_EQ(fleet.coordinator().unit({7}).phase, UnitPhase::kReady);
}

TEST(Configuration, ACommandWhoseRowIsRefusedIsNotDone) {
  InProcessFleet fleet(Small(46));
  fleet.Run(Seconds(3));
  fleet.storage.refuse = [](const Row& row) { return std::holds_alternative<ModelRow>(row); };
  fleet.Send({900, KeepRowsCommand{{ModelRow{.entry = 1}}}});
  fleet.Send({901, EnableCommand{{{5}}, false, "fibre broken"}});
  fleet.Run(Seconds(1));
  ASSERT_TRUE(fleet.LastReply(900));
  ASSERT_TRUE(fleet.LastReply(900)->error);
  EXPECT_NE(fleet.LastReply(900)->error->text.find("NOT stored"), std::string::npos);
}

TEST(Configuration, AnAlarmThatTheStoreRefusesBegetsNoOther) {
  InProcessFleet fleet(Small(49));
  std::size_t refused = 0;
  fleet.storage.refuse = [&refused](const Row& row) {
    const bool is_alarm = std::holds_alternative<AlarmRow>(row);
    refused += is_alarm ? 1u : 0u;
    return is_alarm;
  };
  fleet.world().disturb().faults(fleet.id(5))->foreign_serial = SerialNumber{0};
  fleet.Restart();
  fleet.Run(Seconds(5));
  EXPECT_GE(refused, 1u);
  EXPECT_LE(refused, 3u) << "one of the unit, and none of that one";
}

TEST(Configuration, DoneIsSaidWhenItIsStored) {
  auto options = Small(41);
  options.commit_delay = Seconds(1);
  InProcessFleet fleet(options);
  fleet.Run(Seconds(5));
  fleet.Send({900, EnableCommand{{{5}}, false, "fibre broken"}});
  fleet.Run(Milliseconds(900));
  EXPECT_FALSE(fleet.LastReply(900));
  fleet.Run(Milliseconds(200));
  ASSERT_TRUE(fleet.LastReply(900));
  EXPECT_FALSE(fleet.LastReply(900)->error);
}

TEST(Configuration, WhatTheStoreDoesNotTakeIsNotDone) {
  InProcessFleet fleet(Small(42));
  fleet.Run(Seconds(5));
  fleet.Send({900, EnableCommand{{{5}}, false, "fibre broken"}});
  fleet.Run(Milliseconds(1));
  fleet.storage.fails = true;  // before this one is durable
  fleet.Run(Seconds(1));
  fleet.Send({901, EnableCommand{{{6}}, false, "too"}});
  fleet.Send({902, WriteParameterCommand{{7}, Axis::kTheta, Parameter::kRepeat, 54}});
  fleet.Run(Seconds(1));
  for (const std::uint64_t request : {900u, 901u, 902u}) {
    ASSERT_TRUE(fleet.LastReply(request)) << request;
    ASSERT_TRUE(fleet.LastReply(request)->error) << request;
    EXPECT_EQ(fleet.LastReply(request)->error->code, ErrorCode::kUnavailable) << request;
    EXPECT_NE(fleet.LastReply(request)->error->text.find("NOT stored"), std::string::npos);
  }
  EXPECT_FALSE(fleet.coordinator().unit({5}).enabled) << "it holds all the same";
}

}  // namespace
}  // namespace focalfleet
