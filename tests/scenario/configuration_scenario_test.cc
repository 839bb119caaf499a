// A configuration from command to rest on the in-process fleet: all well, and one unit, bus or
// message wrong at a time.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

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
using test::RunIntoMotion;
using test::Small;
using test::SomebodyMoving;
using test::Unserved;

TEST(Configuration, AllUnitsArriveAndTheStoreKnowsIt) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    FOCALFLEET_TRACE_SEED(seed);
    InProcessFleet fleet(Small(seed));
    const auto request = fleet.ApplyRandom(seed);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
    EXPECT_EQ(fleet.coordinator().configuration().counts.arrived, 37u);
    EXPECT_EQ(fleet.coordinator().configuration().round, 1u);
    ASSERT_TRUE(fleet.LastReply(request));
    EXPECT_TRUE(fleet.LastReply(request)->last);
    ExpectOthersArrive(&fleet, 0);
    EXPECT_TRUE(fleet.store().alarms.empty());
  }
}

TEST(Configuration, SecondOneStartsFromWhereTheFirstEnded) {
  InProcessFleet fleet(Small(5));
  for (const std::uint64_t seed : {10u, 11u, 12u}) {
    fleet.ApplyRandom(seed);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
  }
  ExpectStoreTellsTheTruth(fleet, "after three configurations");
}

// The store has to claim the whole way from the commit on. Whoever looks on is shown the place
// where the unit stands until it begins.
TEST(Configuration, UnitThatHasNotBegunIsShownWhereItStands) {
  InProcessFleet fleet(Small(7));
  const Coordinator& coordinator = fleet.coordinator();
  fleet.ApplyRandom(7);
  std::size_t intended = 0;
  ASSERT_TRUE(fleet.RunUntil(
      [&] {
        for (std::uint32_t n = 0; n < fleet.layout().size(); ++n) {
          if (coordinator.unit({n}).phase != UnitPhase::kArmed) continue;
          const UnitKnowledge shown = coordinator.KnowledgeAt({n}, fleet.now());
          const UnitKnowledge& known = coordinator.unit({n}).knowledge;
          for (const std::size_t a : {0u, 1u}) {
            EXPECT_EQ(shown[a].low, shown[a].high) << n;
            if (known[a].witness != Witness::kInterval) continue;
            ++intended;
            EXPECT_TRUE(known[a].low <= shown[a].low && shown[a].low <= known[a].high) << n;
          }
        }
        return coordinator.configuration().state == ConfigurationState::kMoving;
      },
      Seconds(60)));
  EXPECT_GT(intended, 0u) << "no intent was seen before the start";
  ASSERT_TRUE(fleet.RunUntilIdle());
}

TEST(Configuration, WhileOneRunsAnotherIsRefused) {
  InProcessFleet fleet(Small(9));
  fleet.ApplyRandom(9);
  RunIntoMotion(&fleet, Seconds(1));
  const auto second = fleet.ApplyRandom(10);
  fleet.Run(Seconds(1));
  ASSERT_TRUE(fleet.LastReply(second));
  ASSERT_TRUE(fleet.LastReply(second)->error);
  EXPECT_EQ(fleet.LastReply(second)->error->code, ErrorCode::kRefused);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), 37u);
}

TEST(Configuration, SilentUnitIsNamedAndTheOthersArrive) {
  InProcessFleet fleet(Small(11));
  fleet.Run(Seconds(2));
  fleet.world().disturb().faults(fleet.id(4))->silent = true;
  fleet.ApplyRandom(11);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const UnitView& view = fleet.coordinator().unit({4});
  EXPECT_EQ(view.outcome, TargetOutcome::kFailed);
  EXPECT_EQ(view.phase, UnitPhase::kSilent);
  EXPECT_NE(view.outcome_reason, "");
  EXPECT_TRUE(HasAlarm(fleet, "unit 5 does not answer"));
  ExpectOthersArrive(&fleet, 4);  // its position may block its neighbours' targets
}

TEST(Configuration, UnitThatNeverAnsweredIsNamedAndTheOthersArrive) {
  InProcessFleet fleet(Small(12));
  fleet.world().disturb().faults(fleet.id(0))->deaf = true;
  fleet.ApplyRandom(12);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({0}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({0}).phase, UnitPhase::kAbsent);
  // Its position is not known, so its six neighbours keep out of its whole reach.
  EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 37u - 7u);
}

TEST(Configuration, PredictsOnlyWhatIsStarted) {
  InProcessFleet fleet(Small(14));
  fleet.world().disturb().faults(fleet.id(7))->wrong_digest =
      true;  // costs a plan before any start
  fleet.ApplyRandom(14);
  ASSERT_TRUE(fleet.RunUntilIdle());
  const ConfigurationView& view = fleet.coordinator().configuration();
  ASSERT_GE(view.round, 2u);
  EXPECT_NEAR(view.makespan_predicted_s, view.makespan_s, 0.1 * view.makespan_s);
  EXPECT_GT(view.energy_J, 0);
}

TEST(Configuration, HomingIsPredicted) {
  InProcessFleet fleet(Small(44));
  fleet.Run(Seconds(5));
  fleet.Send({900, HomeCommand{{{4}}, true}});
  ASSERT_TRUE(fleet.RunUntilIdle());
  const ConfigurationView& view = fleet.coordinator().configuration();
  EXPECT_EQ(view.counts.arrived, 1u);
  EXPECT_GT(view.makespan_s, 10);
  EXPECT_NEAR(view.makespan_predicted_s, view.makespan_s, 0.1 * view.makespan_s);
  EXPECT_GT(view.energy_J, 0);
  EXPECT_GT(view.peak_power_W, 0);
}

TEST(Configuration, HomingTellsNothingOfTheOneBefore) {
  InProcessFleet fleet(Small(45));
  fleet.world().disturb().faults(fleet.id(7))->wrong_digest = true;
  fleet.ApplyRandom(45);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ASSERT_EQ(fleet.coordinator().unit({7}).outcome, TargetOutcome::kFailed);
  fleet.Send({900, HomeCommand{{{4}}, true}});
  ASSERT_TRUE(fleet.RunUntilIdle());
  for (std::uint32_t n = 0; n < 37; ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    EXPECT_EQ(view.outcome, n == 4 ? TargetOutcome::kArrived : TargetOutcome::kNone) << n;
    EXPECT_EQ(view.outcome_reason, "") << n;
    EXPECT_FALSE(view.target) << n;
  }
}

TEST(Configuration, TellsTheWayOutOfAFault) {
  InProcessFleet fleet(Small(46));
  fleet.Run(Seconds(5));
  fleet.world().disturb().RaiseFault(fleet.id(8), FaultCode::kDriver);
  fleet.Run(Seconds(30));
  fleet.Send({900, HomeCommand{{{8}}}});
  fleet.Run(Seconds(1));
  ASSERT_TRUE(fleet.LastReply(900) && fleet.LastReply(900)->error);
  EXPECT_EQ(fleet.LastReply(900)->error->text,
            "unit 9 cannot home: it is in fault (driver): `focalfleet enable 9` clears it");
  fleet.ApplyRandom(46);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({8}).outcome_reason,
            "it is in fault (driver): `focalfleet enable 9` clears it");
  fleet.Send({901, EnableCommand{{{8}}}});
  fleet.Run(Seconds(5));
  EXPECT_EQ(fleet.coordinator().unit({8}).phase, UnitPhase::kReady);
}

TEST(Configuration, LateAndDoubledAnswersAreNoTrouble) {
  InProcessFleet fleet(Small(13));
  for (std::uint32_t n = 0; n < 37; ++n) {
    fleet.world().disturb().faults(fleet.id(n))->late =
        Milliseconds(n * 2);  // up to past the deadline
    fleet.world().disturb().faults(fleet.id(n))->copies = static_cast<std::uint8_t>(1 + n % 3);
  }
  fleet.ApplyRandom(13);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Configuration, WrongReadBackIsRetriedThenNamed) {
  InProcessFleet fleet(Small(14));
  fleet.world().disturb().faults(fleet.id(7))->wrong_digest = true;
  fleet.ApplyRandom(14);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({7}).outcome, TargetOutcome::kFailed);
  EXPECT_NE(fleet.coordinator().unit({7}).outcome_reason.find("read-back"), std::string::npos);
  EXPECT_EQ(fleet.world().Truth(std::size_t{7}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(Configuration, FaultInMotionStopsWhoDependsOnItAndTheOthersArriveLater) {
  InProcessFleet fleet(Small(15));
  fleet.world().disturb().faults(fleet.id(3))->in_motion =
      sim::UnitFaults::InMotion{.after = Seconds(2)};
  fleet.ApplyRandom(15);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({3}).outcome, TargetOutcome::kFailed);
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kFault);
  EXPECT_EQ(fleet.coordinator().unit({3}).knowledge[0].witness, Witness::kReported);
  fleet.Run(Seconds(5));
  EXPECT_TRUE(
      HasAlarm(fleet, std::string("unit 4 is in fault: ") + Name(FaultCode::kOverTemperature)))
      << "the end of its motion did not know which fault";
  ExpectOthersArrive(&fleet, 4);
}

// The unit's own report is lost, and it stands short of its end. No other host has stopped it.
TEST(Configuration, AFaultThatIsFoundByAskingIsNoStopOfSomebodyElse) {
  InProcessFleet fleet(Small(15));
  sim::UnitFaults* faults = fleet.world().disturb().faults(fleet.id(3));
  faults->in_motion = sim::UnitFaults::InMotion{.after = Seconds(2)};
  faults->mute_done = true;
  fleet.ApplyRandom(15);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({3}).phase, UnitPhase::kFault);
  EXPECT_EQ(fleet.coordinator().configuration().state, ConfigurationState::kDone);
  EXPECT_FALSE(HasAlarm(fleet, "by somebody else"));
  ExpectOthersArrive(&fleet, 4);
}

TEST(Configuration, LostDoneReportsAreAskedFor) {
  InProcessFleet fleet(Small(16));
  for (const std::uint32_t n : {1u, 8u, 20u})
    fleet.world().disturb().faults(fleet.id(n))->mute_done = true;
  fleet.ApplyRandom(16);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Configuration, FramesLostAtRandomDelayButDoNotFail) {
  for (const std::uint64_t seed : {17u, 18u, 19u}) {
    FOCALFLEET_TRACE_SEED(seed);
    InProcessFleet fleet(Small(seed));
    for (const BusId bus : fleet.layout().buses()) {
      fleet.world().disturb().faults(bus)->drop = 0.02;
      fleet.world().disturb().faults(bus)->duplicate = 0.02;
    }
    fleet.ApplyRandom(seed);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 2);
  }
}

TEST(Configuration, DeadBusTakesOnlyItsUnits) {
  InProcessFleet fleet(Small(20));
  fleet.Run(Seconds(2));
  const BusId dead = fleet.layout().buses()[1];
  fleet.world().disturb().KillBus(dead);
  fleet.ApplyRandom(20);
  ASSERT_TRUE(fleet.RunUntilIdle());
  for (std::uint32_t n = 0; n < 37; ++n) {
    const UnitView& view = fleet.coordinator().unit({n});
    if (fleet.layout().units()[n].bus == dead) {
      EXPECT_EQ(view.outcome, TargetOutcome::kFailed) << n;
      EXPECT_EQ(view.phase, UnitPhase::kSilent) << n;
      EXPECT_TRUE(IsPlace(view.knowledge)) << n;  // it stood still, and that is known
    }
  }
  EXPECT_GE(CountOutcome(fleet, TargetOutcome::kArrived), 15u);
  fleet.world().disturb().ReviveBus(dead);
  fleet.Run(Seconds(10));
  fleet.ApplyRandom(21);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

// A controller warns, goes passive, then off in mid-move, and comes back.
TEST(Configuration, EveryStepOfALinkIsReportedWithItsCauseAndOnlyOffLosesUnits) {
  InProcessFleet fleet(Small(23));
  const BusId sick = fleet.layout().buses()[2];
  const auto phases = [&](UnitPhase phase) {
    int count = 0;
    for (std::uint32_t n = 0; n < fleet.layout().size(); ++n)
      count += fleet.layout().units()[n].bus == sick && fleet.coordinator().unit({n}).phase == phase
                   ? 1
                   : 0;
    return count;
  };
  const auto of_bus =
      static_cast<int>(std::ranges::count(fleet.layout().units(), sick, &Unit::bus));
  fleet.Run(Seconds(2));
  fleet.ReportLink({sick, LinkState::kUp, "the controller warns of errors (bit error)"});
  fleet.ReportLink({sick, LinkState::kPassive, "the controller is error-passive (bit error)"});
  fleet.ApplyRandom(23);
  RunIntoMotion(&fleet, Seconds(2));
  EXPECT_GT(phases(UnitPhase::kMoving), 0) << "a passive controller still carries frames";
  fleet.world().disturb().KillBus(sick);
  fleet.ReportLink({sick, LinkState::kOff, "the controller is bus-off (no acknowledgement)"});
  fleet.Run(Milliseconds(10));
  EXPECT_EQ(phases(UnitPhase::kSilent), of_bus) << "at once, from passive as from up";
  fleet.ReportLink(
      {sick, LinkState::kOff, "the controller is bus-off; no privilege to restart it"});
  fleet.ReportLink({sick, LinkState::kDown, "the interface is down"});
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectStoreTellsTheTruth(fleet, "while the bus is off");
  const std::string name = "bus " + std::to_string(sick.value);
  for (const std::string& part :
       {name + ": the controller warns of errors (bit error)",
        name + " is passive: the controller is error-passive (bit error)",
        name + " is off: the controller is bus-off (no acknowledgement); its " +
            std::to_string(of_bus) + " units cannot be",
        name + ": the controller is bus-off; no privilege to restart it",
        name + " is down: the interface is down"})
    EXPECT_TRUE(HasAlarm(fleet, part)) << part;
  EXPECT_FALSE(HasAlarm(fleet, "the interface is down; its")) << "they were lost before";
  EXPECT_NE(Unserved(fleet).find("it cannot be reached: " + name + " is off"), std::string::npos)
      << Unserved(fleet);
  fleet.world().disturb().ReviveBus(sick);
  fleet.ReportLink({sick, LinkState::kUp, ""});
  fleet.Run(Seconds(10));
  EXPECT_EQ(phases(UnitPhase::kReady), of_bus);
  fleet.ApplyRandom(24);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

// The bus' units hear the host's clock through a passive controller; otherwise they would give the
// host up.
TEST(Configuration, UnitsBehindAPassiveControllerKeepTheirHost) {
  InProcessFleet fleet(Small(24));
  fleet.Run(Seconds(2));
  const auto sent = [&](std::size_t bus) {
    return fleet.coordinator().bus(fleet.layout().buses()[bus]).frames_sent;
  };
  const std::uint64_t passive_before = sent(0);
  const std::uint64_t up_before = sent(1);
  fleet.ReportLink({fleet.layout().buses()[0], LinkState::kPassive, ""});
  fleet.Run(Seconds(20));
  const auto passive = static_cast<double>(sent(0) - passive_before);
  const auto up = static_cast<double>(sent(1) - up_before);
  EXPECT_NEAR(passive / up, 1, 0.1) << "clock frames and polls";
}

TEST(Configuration, PowerCutInMidMoveLeavesAnIntervalThatHoldsTheTruth) {
  InProcessFleet fleet(Small(22));
  fleet.ApplyRandom(22);
  RunIntoMotion(&fleet, Seconds(2));
  const PositionerIndex victim = SomebodyMoving(&fleet);
  fleet.world().disturb().PowerCut(fleet.id(victim.value));
  fleet.Run(Seconds(3));
  fleet.world().disturb().PowerOn(fleet.id(victim.value));
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.Run(Seconds(15));
  const UnitView& view = fleet.coordinator().unit(victim);
  EXPECT_EQ(view.knowledge[0].witness, Witness::kInterval);
  EXPECT_EQ(view.phase, UnitPhase::kReady);
  ExpectStoreTellsTheTruth(fleet, "after the power cut");

  // The unit is refused by name until it is homed, and then it arrives.
  fleet.ApplyRandom(22);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit(victim).outcome, TargetOutcome::kRefused);
  fleet.Send({1000, HomeCommand{{victim}}});
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit(victim).knowledge[0].witness, Witness::kReported)
      << fleet.coordinator().unit(victim).outcome_reason;
  ExpectStoreTellsTheTruth(fleet, "after homing");
  fleet.ApplyRandom(22);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Configuration, DisabledUnitIsPassedOverByName) {
  InProcessFleet fleet(Small(28));
  fleet.Run(Seconds(2));
  fleet.Send({902, EnableCommand{{{5}}, false, "fibre broken"}});
  fleet.ApplyRandom(28);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit({5}).outcome, TargetOutcome::kRefused);
  EXPECT_NE(fleet.coordinator().unit({5}).outcome_reason.find("fibre broken"), std::string::npos);
  EXPECT_EQ(fleet.world().Truth(std::size_t{5}).moves_begun, 0u);
  ExpectOthersArrive(&fleet, 4);
}

TEST(Configuration, SameSeedSameFrames) {
  std::uint64_t digests[2];
  for (auto& digest : digests) {
    InProcessFleet fleet(Small(31));
    for (const BusId bus : fleet.layout().buses()) fleet.world().disturb().faults(bus)->drop = 0.01;
    fleet.ApplyRandom(31);
    EXPECT_TRUE(fleet.RunUntilIdle());
    digest = fleet.digest();
  }
  EXPECT_EQ(digests[0], digests[1]);
}

}  // namespace
}  // namespace focalfleet
