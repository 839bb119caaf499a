// In these tests units refuse, stay silent, answer late or under another number, or give false
// answers. Such an answer is never taken for success, never holds up the other units, and is always
// named. The page docs/peers.md gives the fault of an earlier system that each test stands for.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "protocol/wire/codec.h"
#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::ExpectOthersArrive;
using test::ExpectStoreTellsTheTruth;
using test::HasAlarm;
using test::InProcessFleet;
using test::Unserved;

std::uint32_t Begun(InProcessFleet& fleet) {
  std::uint32_t begun = 0;
  for (std::size_t n = 0; n < fleet.layout().size(); ++n)
    begun += fleet.world().Truth(n).moves_begun;
  return begun;
}

/// Expects that no unit moved, and that each is named with a reason that has `part` in it.
void ExpectNothingStarted(InProcessFleet& fleet, const std::string& part, const std::string& when) {
  EXPECT_EQ(Begun(fleet), 0u) << when;
  EXPECT_EQ(fleet.coordinator().configuration().counts.arrived, 0u) << when;
  for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    EXPECT_EQ(view.outcome, TargetOutcome::kFailed) << when << ", row " << n;
    EXPECT_NE(view.outcome_reason.find(part), std::string::npos)
        << when << ", row " << n << ": " << view.outcome_reason;
  }
  fleet.Run(Milliseconds(100));
  ExpectStoreTellsTheTruth(fleet, when);
  EXPECT_TRUE(fleet.store().fleet.open_intents.empty()) << when;
}

template <class Plant>
void PlantInAll(InProcessFleet* fleet, const Plant& plant) {
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n)
    plant(fleet->world().disturb().faults(fleet->id(n)));
}

constexpr Answer kRefusals[] = {Answer::kWrongMove,  Answer::kIncomplete,  Answer::kOutOfRange,
                                Answer::kWrongState, Answer::kBegunBefore, Answer::kBadValue,
                                Answer::kInterrupted};

TEST(WrongAnswer, EveryUnitRefusesItsMoveAndNothingStarts) {
  for (const Function what : {Function::kConfirm, Function::kArm})
    for (const Answer answer : kRefusals) {
      InProcessFleet fleet({.count = 7, .seed = 60});
      PlantInAll(&fleet, [&](sim::UnitFaults* faults) {
        faults->refuses = sim::UnitFaults::Refusal{what, answer};
      });
      const auto request = fleet.ApplyRandom(60);
      const std::string when =
          std::string(what == Function::kArm ? "arm, " : "confirm, ") + Name(answer);
      ASSERT_TRUE(fleet.RunUntilIdle(Seconds(60))) << when;
      ExpectNothingStarted(fleet, Name(answer), when);
      EXPECT_TRUE(fleet.LastReply(request)->last) << when;
    }
}

TEST(WrongAnswer, NobodyAnswersAndNothingStarts) {
  for (const Function what : {Function::kConfirm, Function::kArm, Function::kIdentify,
                              Function::kStatus, Function::kVector, Function::kParameterRead}) {
    const std::string when = "function " + std::to_string(static_cast<int>(what));
    InProcessFleet fleet({.count = 7, .seed = 61});
    PlantInAll(&fleet, [&](sim::UnitFaults* faults) { faults->ignores = what; });
    fleet.ApplyRandom(61);
    ASSERT_TRUE(fleet.RunUntilIdle(Seconds(60))) << when;
    EXPECT_EQ(Begun(fleet), 0u) << when;
    EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kFailed), 7u) << when << "\n" << Unserved(fleet);
    for (std::uint32_t n = 0; n < 7; ++n)
      EXPECT_NE(fleet.coordinator().unit({n}).outcome_reason, "") << when;
  }
}

TEST(WrongAnswer, OneRefusesAndOnlyItStays) {
  for (const Function what : {Function::kConfirm, Function::kArm}) {
    InProcessFleet fleet({.count = 37, .seed = 62});
    fleet.world().disturb().faults(fleet.id(9))->refuses =
        sim::UnitFaults::Refusal{what, Answer::kOutOfRange};
    fleet.ApplyRandom(62);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(fleet.coordinator().unit({9}).outcome, TargetOutcome::kFailed);
    EXPECT_EQ(fleet.world().Truth(std::size_t{9}).moves_begun, 0u);
    EXPECT_TRUE(HasAlarm(fleet, "unit 10 refuses"));
    ExpectOthersArrive(&fleet, 4);
  }
}

TEST(WrongAnswer, RefusedHomingIsNamed) {
  InProcessFleet fleet({.count = 7, .seed = 63});
  fleet.Run(Seconds(5));
  fleet.world().disturb().faults(fleet.id(2))->refuses =
      sim::UnitFaults::Refusal{Function::kHome, Answer::kBadValue};
  fleet.Send({900, HomeCommand{{{2}}, true}});
  ASSERT_TRUE(fleet.RunUntilIdle(Seconds(120)));
  EXPECT_EQ(fleet.coordinator().unit({2}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({2}).outcome_reason, "refuses to home: bad_value");
  fleet.Run(Seconds(2));
  EXPECT_TRUE(IsPlace(fleet.coordinator().unit({2}).knowledge)) << "it has not moved";
  EXPECT_TRUE(fleet.store().fleet.open_intents.empty());
  ExpectStoreTellsTheTruth(fleet, "after the refusal");
}

// ---- one unit among many

TEST(OneUnit, DiesInTheUploadOfTwoHundredAndHoldsThemUpForAMoment) {
  InProcessFleet fleet({.count = 200, .units_per_bus = 100, .seed = 64});
  fleet.Run(Seconds(5));
  fleet.ApplyRandom(64);
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kUploading; },
      Seconds(60)));
  const HostInstant uploading = fleet.now();
  fleet.world().disturb().faults(fleet.id(150))->silent = true;
  ASSERT_TRUE(fleet.RunUntil([&] { return Begun(fleet) != 0; }, Seconds(60)));
  // The time is five tries of 50 to 800 ms, then a plan around the unit and another upload.
  EXPECT_LT((fleet.now() - uploading).seconds(), 3.0);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({150}).outcome, TargetOutcome::kFailed);
  EXPECT_TRUE(HasAlarm(fleet, "unit 151 does not answer"));
  ExpectOthersArrive(&fleet, 4);
}

std::map<std::pair<std::uint32_t, int>, int> UploadsByNode(const std::vector<OutFrame>& sent) {
  std::map<std::pair<std::uint32_t, int>, int> uploads;
  for (const OutFrame& out : sent)
    if (const auto message = DecodeHost(out.frame);
        message && std::holds_alternative<StageBegin>(message->message))
      ++uploads[{out.bus.value, message->address.node.value}];
  return uploads;
}

TEST(OneUnit, LosesAFrameOfItsMoveAndIsSentItAgainAlone) {
  InProcessFleet fleet({.count = 37, .seed = 65});
  std::vector<OutFrame> sent;
  fleet.sent = &sent;
  fleet.world().disturb().faults(fleet.id(12))->loses_segments = 1;
  fleet.ApplyRandom(65);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
  EXPECT_EQ(fleet.coordinator().configuration().round, 1u);
  const Unit& loser = fleet.layout().units()[12];
  for (const auto& [where, count] : UploadsByNode(sent)) {
    const bool is_loser = where == std::pair<std::uint32_t, int>{loser.bus.value, loser.node.value};
    EXPECT_EQ(count, is_loser ? 2 : 1) << where.first << "." << where.second;
  }
}

TEST(OneUnit, LosesItsMoveForEverAndIsNamedWhileTheOthersArrive) {
  InProcessFleet fleet({.count = 37, .seed = 65});
  fleet.world().disturb().faults(fleet.id(12))->loses_segments = 1'000'000;
  fleet.ApplyRandom(65);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const UnitView& view = fleet.coordinator().unit({12});
  EXPECT_EQ(view.outcome, TargetOutcome::kFailed);
  EXPECT_EQ(view.outcome_reason, "refuses its move: incomplete");
  EXPECT_EQ(fleet.world().Truth(std::size_t{12}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(OneUnit, AskedMoreOftenThanThereAreSequenceNumbersComesBackAtOnce) {
  InProcessFleet fleet({.count = 7, .seed = 66});
  fleet.Run(Seconds(3));
  fleet.world().disturb().faults(fleet.id(3))->silent = true;
  const std::uint64_t before = fleet.coordinator().bus({0}).retries;
  fleet.Run(Seconds(1200));
  EXPECT_GT(fleet.coordinator().bus({0}).retries - before, 254u * 4) << "or this tries nothing";
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kSilent);
  fleet.world().disturb().faults(fleet.id(3))->silent = false;
  fleet.Run(Seconds(4));
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kReady);
  fleet.ApplyRandom(66);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

// ---- late, and under another number

TEST(LateAnswer, UnderTheNumberOfTheRequestBeforeIsNoAnswer) {
  InProcessFleet fleet({.count = 37, .seed = 67});
  fleet.Run(Seconds(5));
  fleet.world().disturb().faults(fleet.id(20))->stale_sequence = true;
  fleet.ApplyRandom(67);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const UnitView& view = fleet.coordinator().unit({20});
  EXPECT_EQ(view.outcome, TargetOutcome::kFailed);
  EXPECT_EQ(view.phase, UnitPhase::kSilent) << "nothing that it says answers anything";
  EXPECT_EQ(fleet.world().Truth(std::size_t{20}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(LateAnswer, AfterTheLastRepeatIsNoAnswerToTheNextQuestion) {
  for (const int late_ms : {1700, 2000, 2400, 3999, 7500}) {
    FOCALFLEET_TRACE_SEED(static_cast<std::uint64_t>(late_ms));
    InProcessFleet fleet({.count = 37, .seed = 68});
    fleet.Run(Seconds(5));
    fleet.world().disturb().faults(fleet.id(20))->late = Milliseconds(late_ms);
    fleet.ApplyRandom(68);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(fleet.coordinator().unit({20}).outcome, TargetOutcome::kFailed);
    EXPECT_EQ(fleet.world().Truth(std::size_t{20}).moves_begun, 0u);
    ExpectOthersArrive(&fleet, 4);
    fleet.world().disturb().faults(fleet.id(20))->late = {};
    fleet.Run(Seconds(15));
    EXPECT_EQ(fleet.coordinator().unit({20}).phase, UnitPhase::kReady);
    fleet.ApplyRandom(69);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
  }
}

// The same node number is on every bus: an answer on one bus is never assigned to another.
TEST(WrongAnswer, OfAnotherBusOrOfNobodysNodeConcernsNobody) {
  std::uint64_t digests[2];
  for (const bool disturbed : {false, true}) {
    InProcessFleet fleet({.count = 19, .units_per_bus = 10, .seed = 70});
    const auto shout = [&](BusId bus, std::uint8_t node) {
      if (!disturbed) return;
      const Address address{{node}, 7};
      for (const UnitMessage& message :
           {UnitMessage{ConfirmReply{{1}, 0, {1, 1}, Answer::kOutOfRange}},
            UnitMessage{ArmReply{{1}, Answer::kWrongState}},
            UnitMessage{StatusReply{.state = UnitState::kFault}},
            UnitMessage{IdentifyReply{.serial = {99}}}})
        fleet.Hear({bus, fleet.now(), Encode(message, address)});
    };
    const BusId larger = fleet.layout().Find({0}, {10}) ? BusId{0} : BusId{1};
    const BusId smaller{1 - larger.value};
    ASSERT_TRUE(fleet.layout().Find(larger, {10}));
    ASSERT_FALSE(fleet.layout().Find(smaller, {10}));
    fleet.ApplyRandom(70);
    for (int k = 0; k < 200; ++k) {
      shout(smaller, 10);
      shout(larger, 77);  // the number of no unit
      fleet.Run(Milliseconds(10));
    }
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
    EXPECT_EQ(fleet.coordinator().bus({0}).malformed, disturbed ? 800u : 0u);
    EXPECT_EQ(fleet.coordinator().bus({1}).malformed, disturbed ? 800u : 0u);
    digests[disturbed ? 1 : 0] = fleet.digest();
  }
  EXPECT_EQ(digests[0], digests[1]);
}

// A unit that was known before runs another firmware, or a boot loader.
TEST(WrongAnswer, WhoSpeaksAnotherVersionIsLeftAloneAndComesBack) {
  InProcessFleet fleet({.count = 37, .seed = 78});
  fleet.ApplyRandom(77);
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.world().disturb().faults(fleet.id(11))->protocol_version = 0;
  fleet.world().disturb().PowerCut(fleet.id(11));
  fleet.world().disturb().PowerOn(fleet.id(11));
  fleet.Run(Seconds(12));  // the next question finds it restarted
  std::vector<OutFrame> sent;
  fleet.sent = &sent;
  fleet.ApplyRandom(78);
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.Run(Seconds(40));
  EXPECT_EQ(fleet.coordinator().unit({11}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({11}).outcome_reason,
            "it speaks protocol version 0, not 1 or 2");
  EXPECT_EQ(fleet.coordinator().unit({11}).knowledge[0].witness, Witness::kUnknown);
  EXPECT_EQ(fleet.world().Truth(std::size_t{11}).moves_begun, 1u);
  EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 30u) << Unserved(fleet);
  const Unit& unit = fleet.layout().units()[11];
  int asked = 0;
  for (const OutFrame& out : sent) {
    const auto heard = DecodeHost(out.frame);
    if (out.bus != unit.bus || heard->address.node != unit.node) continue;
    EXPECT_TRUE(std::holds_alternative<IdentifyRequest>(heard->message));
    ++asked;
  }
  EXPECT_GT(asked, 20);
  EXPECT_LT(asked, 60) << "every 2 s";
  const auto said = std::count_if(fleet.store().alarms.begin(), fleet.store().alarms.end(),
                                  [](const AlarmRow& alarm) {
                                    return alarm.text.find("protocol version") != std::string::npos;
                                  });
  EXPECT_EQ(said, 1);
  fleet.world().disturb().faults(fleet.id(11))->protocol_version.reset();
  fleet.Run(Seconds(4));
  EXPECT_EQ(fleet.coordinator().unit({11}).phase, UnitPhase::kReady);
  fleet.ApplyRandom(79);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

// ---- units with false answers

TEST(Liar, WhoSaysThatItHasArrivedAndNeverStartedIsNotBelieved) {
  InProcessFleet fleet({.count = 37, .seed = 71});
  fleet.world().disturb().faults(fleet.id(5))->claims_arrival = true;
  fleet.ApplyRandom(71);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const UnitView& view = fleet.coordinator().unit({5});
  EXPECT_EQ(view.outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.world().Truth(std::size_t{5}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(Liar, WhoIgnoresEveryStartIsNamedAndItsMoveTakenBack) {
  InProcessFleet fleet({.count = 37, .seed = 72});
  fleet.world().disturb().faults(fleet.id(5))->ignores = Function::kStart;
  fleet.ApplyRandom(72);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({5}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({5}).outcome_reason, "does not begin to move");
  EXPECT_EQ(fleet.world().Truth(std::size_t{5}).state, UnitState::kRest);
  EXPECT_EQ(fleet.world().Truth(std::size_t{5}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

// ---- settings that differ from those of the plans

TEST(Settings, AUnitsOwnCarrierIsReplacedBeforeItMoves) {
  InProcessFleet fleet({.count = 7, .seed = 73, .factory = {.counter1 = 400}});
  fleet.ApplyRandom(73);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
  for (std::uint32_t n = 0; n < 7; ++n)
    EXPECT_EQ(fleet.world().flash(fleet.id(n)).axis[0].counter1, 500);
}

TEST(Settings, WhoKeepsAnotherCarrierIsNotMoved) {
  InProcessFleet fleet({.count = 37, .seed = 74, .factory = {.counter1 = 400}});
  fleet.world().disturb().faults(fleet.id(5))->refuses =
      sim::UnitFaults::Refusal{Function::kParameterWrite, Answer::kBadValue};
  fleet.ApplyRandom(74);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.world().Truth(std::size_t{5}).moves_begun, 0u) << "it is faster than planned";
  const std::string why = "it is not fit to move: theta counter1 is 400, not 500 as set";
  EXPECT_EQ(fleet.coordinator().unit({5}).outcome_reason, why);
  ExpectOthersArrive(&fleet, 4);
  fleet.Send({900, HomeCommand{{{5}}, true}});
  fleet.Run(Seconds(1));
  ASSERT_TRUE(fleet.LastReply(900) && fleet.LastReply(900)->error);
  const auto alarms = fleet.store().alarms.size();
  fleet.Run(Seconds(60));
  EXPECT_EQ(fleet.store().alarms.size(), alarms) << "said once";
  // The unit is checked repeatedly, and goes when it accepts its setting.
  fleet.world().disturb().faults(fleet.id(5))->refuses.reset();
  fleet.Run(Seconds(15));
  fleet.ApplyRandom(75);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Settings, WhoCountsByAnotherSubdivisionIsNotMoved) {
  InProcessFleet fleet({.count = 7, .seed = 76, .factory = {.subdivision = 192}});
  fleet.ApplyRandom(76);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(Begun(fleet), 0u) << "each would go half as far as planned";
  for (std::uint32_t n = 0; n < 7; ++n)
    EXPECT_EQ(fleet.coordinator().unit({n}).outcome_reason,
              "it is not fit to move: theta subdivision is 192, not 96 as set");
  // After an operator gives the unit the other setting, it goes.
  for (const Axis axis : kAxes) {
    const std::uint64_t request = 900 + Index(axis);
    fleet.Send({request, WriteParameterCommand{{2}, axis, Parameter::kSubdivision, 96}});
    fleet.Run(Seconds(1));
    ASSERT_TRUE(fleet.LastReply(request));
    EXPECT_FALSE(fleet.LastReply(request)->error) << fleet.LastReply(request)->error->text;
  }
  EXPECT_EQ(fleet.coordinator().unit({2}).phase, UnitPhase::kReady);
}

TEST(Settings, ASlowerUnitIsSlowerOnTheWire) {
  double took_s[2];
  for (const bool slow : {false, true}) {
    InProcessFleet fleet({.count = 1, .seed = 77});
    fleet.Run(Seconds(5));
    for (const Axis axis : kAxes) {
      if (!slow) continue;
      const std::uint64_t request = 900 + Index(axis);
      fleet.Send({request, WriteParameterCommand{{0}, axis, Parameter::kRepeat, 216}});
      fleet.Run(Seconds(1));
      ASSERT_TRUE(fleet.LastReply(request) && !fleet.LastReply(request)->error);
    }
    fleet.ApplyRandom(77);
    const auto state = [&](UnitState wanted) {
      return [&fleet, wanted] { return fleet.world().Truth(std::size_t{0}).state == wanted; };
    };
    ASSERT_TRUE(fleet.RunUntil(state(UnitState::kMoving), Seconds(10)));
    const HostInstant began = fleet.now();
    ASSERT_TRUE(fleet.RunUntil(state(UnitState::kRest), Seconds(300)));
    took_s[slow ? 1 : 0] = (fleet.now() - began).seconds();
  }
  EXPECT_NEAR(took_s[1] / took_s[0], 2, 0.02);
}

}  // namespace
}  // namespace focalfleet
