// Stops of a configuration on the in-process fleet: by the coordinator, and by another host on the
// buses. After either, every unit rests at a known place.
#include <gtest/gtest.h>

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
using test::RunIntoMotion;
using test::Small;
using test::SomebodyMoving;
using test::StopDirectly;
using test::Unserved;

TEST(Configuration, StopOfAllLeavesEveryUnitAtAKnownPlace) {
  InProcessFleet fleet(Small(23));
  fleet.ApplyRandom(23);
  RunIntoMotion(&fleet, Seconds(3));
  fleet.Send({900, StopCommand{}});
  ASSERT_TRUE(fleet.RunUntilIdle(Seconds(10)));
  EXPECT_EQ(fleet.coordinator().configuration().state, ConfigurationState::kStopped);
  for (std::uint32_t n = 0; n < 37; ++n) {
    EXPECT_TRUE(IsPlace(fleet.coordinator().unit({n}).knowledge)) << n;
    EXPECT_NE(fleet.world().Truth(n).state, UnitState::kMoving) << n;
  }
  fleet.Run(Milliseconds(100));
  ExpectStoreTellsTheTruth(fleet, "after the stop");
  fleet.ApplyRandom(23);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

TEST(Configuration, StopInEveryStateEndsTheConfiguration) {
  for (int ms = 0; ms < 1500; ms += 50) {
    InProcessFleet fleet(Small(24));
    fleet.Run(Seconds(1));
    fleet.ApplyRandom(24);
    fleet.Run(Milliseconds(ms));
    fleet.Send({900, StopCommand{}});
    ASSERT_TRUE(fleet.RunUntilIdle(Seconds(10))) << ms;
    fleet.Run(Seconds(2));
    for (std::uint32_t n = 0; n < 37; ++n)
      EXPECT_EQ(fleet.world().Truth(n).state, UnitState::kRest) << ms << " ms, row " << n;
    ExpectStoreTellsTheTruth(fleet, std::to_string(ms) + " ms");
  }
}

TEST(Configuration, StopOfOneUnitLetsTheOthersArrive) {
  InProcessFleet fleet(Small(25));
  fleet.ApplyRandom(25);
  RunIntoMotion(&fleet, Seconds(1));
  const PositionerIndex one = SomebodyMoving(&fleet);
  fleet.Send({900, StopCommand{one}});
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_EQ(fleet.coordinator().unit(one).outcome, TargetOutcome::kStopped);
  EXPECT_TRUE(IsPlace(fleet.coordinator().unit(one).knowledge));
  ExpectOthersArrive(&fleet, 4);
}

TEST(Configuration, AStopIsAnOutcomeOfItsOwn) {
  InProcessFleet fleet(Small(43));
  const auto request = fleet.ApplyRandom(43);
  RunIntoMotion(&fleet, Seconds(3));
  fleet.Send({900, StopCommand{}});
  ASSERT_TRUE(fleet.RunUntilIdle());
  fleet.Run(Seconds(1));  // its last row becomes durable
  const ConfigurationView& view = fleet.coordinator().configuration();
  EXPECT_EQ(view.state, ConfigurationState::kStopped);
  EXPECT_EQ(view.counts.failed, 0u) << "nobody failed";
  EXPECT_GT(view.counts.stopped, 20u);
  EXPECT_EQ(view.counts.stopped + view.counts.arrived + view.counts.refused, view.counts.targeted);
  EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kStopped), view.counts.stopped);
  EXPECT_EQ(fleet.store().configurations.back().counts.stopped, view.counts.stopped);
  ASSERT_TRUE(fleet.LastReply(request));
  EXPECT_EQ(fleet.LastReply(request)->text, "stopped");
}

// Expects that the configuration has ended, that all units stand at known positions, and that none
// moves before the next apply.
void ExpectStoppedForGood(InProcessFleet* fleet, const std::string& when) {
  ASSERT_TRUE(fleet->RunUntilIdle(Seconds(20))) << when;
  EXPECT_EQ(fleet->coordinator().configuration().state, ConfigurationState::kStopped) << when;
  EXPECT_EQ(CountOutcome(*fleet, TargetOutcome::kPending), 0u) << when;
  std::vector<std::uint32_t> begun;
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n)
    begun.push_back(fleet->world().Truth(n).moves_begun);
  fleet->Run(Seconds(30));
  EXPECT_TRUE(HasAlarm(*fleet, "was stopped on the bus by somebody else")) << when;
  for (std::uint32_t n = 0; n < fleet->layout().size(); ++n) {
    EXPECT_EQ(fleet->world().Truth(n).state, UnitState::kRest) << when << ", row " << n;
    EXPECT_EQ(fleet->world().Truth(n).moves_begun, begun[n]) << when << ", row " << n;
    EXPECT_TRUE(IsPlace(fleet->coordinator().unit({n}).knowledge)) << when << ", row " << n;
  }
  ExpectStoreTellsTheTruth(*fleet, when);
  const auto again = fleet->ApplyRandom(24);
  ASSERT_TRUE(fleet->RunUntilIdle()) << when;
  EXPECT_FALSE(fleet->LastReply(again)->error) << when;
  EXPECT_EQ(CountOutcome(*fleet, TargetOutcome::kArrived), 37u) << when << "\n" << Unserved(*fleet);
}

TEST(Configuration, StopOfSomebodyElseEndsItInEveryState) {
  for (const int ms : {0, 10, 100, 200, 300, 400, 500, 600, 800, 1500, 8000}) {
    InProcessFleet fleet(Small(24));
    fleet.Run(Seconds(1));
    const auto request = fleet.ApplyRandom(24);
    fleet.Run(Milliseconds(ms));
    StopDirectly(&fleet);
    ExpectStoppedForGood(&fleet, std::to_string(ms) + " ms");
    EXPECT_EQ(fleet.LastReply(request)->text, "stopped");
  }
}

TEST(Configuration, StopOfSomebodyElseHoldsWhileTheCoordinatorStoodStill) {
  for (const auto heard : {InProcessFleet::Heard::kWaits, InProcessFleet::Heard::kLost}) {
    for (const int ms : {10, 3000, 60'000}) {
      InProcessFleet fleet(Small(24));
      fleet.ApplyRandom(24);
      RunIntoMotion(&fleet, Seconds(3));
      fleet.Freeze(Milliseconds(100), InProcessFleet::Heard::kWaits);
      StopDirectly(&fleet);
      fleet.Freeze(Milliseconds(ms), heard);
      ExpectStoppedForGood(&fleet, std::to_string(ms) + " ms");
    }
  }
}

// Late or repeated answers to stops of this host, of which there may be several.
TEST(Configuration, LateAnswersToOurStopsAreNobodyElsesStops) {
  for (std::uint64_t seed = test::TestSeed(60); seed < test::TestSeed(60) + 30; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    InProcessFleet fleet(Small(seed));
    fleet.Run(Seconds(2));
    for (const BusId bus : fleet.layout().buses())
      *fleet.world().disturb().faults(bus) = {
          .duplicate = 0.2, .late = 0.3, .late_by = Milliseconds(1200)};
    fleet.ApplyRandom(seed);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_FALSE(HasAlarm(fleet, "by somebody else"));
    ExpectStoreTellsTheTruth(fleet, "with late answers");
  }
}

TEST(Configuration, StopOfOneUnitBySomebodyElseStopsAll) {
  InProcessFleet fleet(Small(25));
  fleet.ApplyRandom(25);
  RunIntoMotion(&fleet, Seconds(1));
  const Unit& one = fleet.layout().unit(SomebodyMoving(&fleet));
  fleet.world().Inject(one.bus, Encode(HostMessage(Stop{}), {one.node, 255}), fleet.now(), 1);
  ExpectStoppedForGood(&fleet, "one");
}

TEST(Configuration, AnswersToAnOwnStopDoNotEndTheNextOne) {
  InProcessFleet fleet(Small(24));
  for (std::uint32_t n = 0; n < 37; ++n) {
    fleet.world().disturb().faults(fleet.id(n))->late = Milliseconds(n * 2);
    fleet.world().disturb().faults(fleet.id(n))->copies = static_cast<std::uint8_t>(1 + n % 3);
  }
  fleet.ApplyRandom(24);
  RunIntoMotion(&fleet, Seconds(3));
  fleet.Send({900, StopCommand{}});
  ASSERT_TRUE(fleet.RunUntilIdle(Seconds(10)));
  fleet.Send({901, StopCommand{}});
  fleet.ApplyRandom(24);
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOthersArrive(&fleet, 0);
}

}  // namespace
}  // namespace focalfleet
