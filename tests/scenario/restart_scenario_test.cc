// Motions that are cut short on the in-process fleet: the coordinator is killed, the power fails,
// or a homing is stopped. The store claims no place that is not true, and work can go on.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>
#include <utility>
#include <variant>
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

// Cuts the homing of a unit after `ms` by `cut`. A position may only be claimed where the unit was
// homed.
void ExpectCutHomingIsNotAPlace(int ms, const std::function<void(InProcessFleet*)>& cut) {
  const std::string when = std::to_string(ms) + " ms";
  InProcessFleet fleet(Small(40));
  fleet.Run(Seconds(2));
  fleet.Send({900, HomeCommand{{{4}}, true}});
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.world().Truth(std::size_t{4}).state == UnitState::kHoming; }, Seconds(5)));
  fleet.Run(Milliseconds(ms));
  cut(&fleet);
  ASSERT_TRUE(fleet.RunUntilIdle(Seconds(20))) << when;
  fleet.Run(Seconds(2));
  const UnitView& view = fleet.coordinator().unit({4});
  EXPECT_EQ(view.knowledge[0].witness, Witness::kInterval) << when;
  EXPECT_EQ(view.knowledge[1].witness, Witness::kInterval) << when;
  EXPECT_TRUE(IsUnserved(view.outcome)) << when;
  EXPECT_FALSE(IsPlace(fleet.store().Vector(view.serial)->knowledge)) << when;
  EXPECT_TRUE(fleet.store().fleet.open_intents.empty()) << when;
  ExpectStoreTellsTheTruth(fleet, when);
  // The unit is homed again, and then its position is known.
  fleet.Send({901, EnableCommand{{{4}}}});
  fleet.Run(Seconds(2));
  fleet.Send({902, HomeCommand{{{4}}, true}});
  ASSERT_TRUE(fleet.RunUntilIdle()) << when;
  EXPECT_EQ(view.outcome, TargetOutcome::kArrived) << when << " " << view.outcome_reason;
  EXPECT_TRUE(IsPlace(view.knowledge)) << when;
  fleet.Run(Milliseconds(100));
  ExpectStoreTellsTheTruth(fleet, when);
}

TEST(Configuration, CutHomingIsNotAPlace) {
  for (const int ms : {100, 500, 1000, 5000, 20'000, 30'000, 45'000}) {
    ExpectCutHomingIsNotAPlace(ms, [](InProcessFleet* fleet) {
      fleet->Send({910, StopCommand{}});
    });
    ExpectCutHomingIsNotAPlace(ms, [](InProcessFleet* fleet) {
      fleet->Send({910, StopCommand{PositionerIndex{4}}});
    });
    ExpectCutHomingIsNotAPlace(ms, [](InProcessFleet* fleet) { StopDirectly(fleet); });
    ExpectCutHomingIsNotAPlace(ms, [](InProcessFleet* fleet) {
      fleet->world().disturb().RaiseFault(fleet->id(4), FaultCode::kDriver);
    });
  }
}

// An earlier run may have ended before it knew the fault, and the fault may be another one since.
TEST(Configuration, AfterARestartTheAlarmOfAUnitNamesItsFaultOnce) {
  const std::string named = std::string("unit 5 is in fault: ") + Name(FaultCode::kDriver);
  const std::string other = std::string("unit 5 is in fault: ") + Name(FaultCode::kFlash);
  for (const auto& [text, renews] :
       {std::pair(std::string("unit 5 stopped with a fault (was moving)"), true),
        std::pair(other, true), std::pair(named + " (2 of its kind in 60 s)", false),
        std::pair(std::string("unit 5 reports fault ") + Name(FaultCode::kDriver), false)}) {
    InProcessFleet fleet(Small(41));
    fleet.Run(Seconds(2));
    fleet.world().disturb().RaiseFault(fleet.id(4), FaultCode::kDriver);
    fleet.Run(Seconds(5));
    fleet.store().fleet.open_alarms = {
        {.id = 1, .name = AlarmName::kUnitFault, .unit = fleet.id(4), .text = text}};
    fleet.store().alarms.clear();
    fleet.Restart();
    fleet.Run(Seconds(10));
    EXPECT_EQ(fleet.coordinator().unit({4}).phase, UnitPhase::kFault) << text;
    EXPECT_EQ(HasAlarm(fleet, named), renews) << text;
    EXPECT_EQ(fleet.store().alarms.size(), renews ? 1u : 0u) << text;
  }
}

// With the coordinator dead the unit's own mark decides how far its vectors are trusted.
TEST(Configuration, KilledWhileHomingTheStoreTellsTheTruth) {
  for (const int ms : {100, 1000, 20'000, 45'000}) {
    for (const bool stopped : {false, true}) {
      const std::string when = std::to_string(ms) + (stopped ? " ms, stopped" : " ms");
      InProcessFleet fleet(Small(40));
      fleet.Run(Seconds(2));
      fleet.Send({900, HomeCommand{{{4}}, true}});
      fleet.Run(Milliseconds(ms));
      if (stopped) StopDirectly(&fleet);
      fleet.Restart();
      fleet.Run(Seconds(90));
      const UnitView& view = fleet.coordinator().unit({4});
      EXPECT_EQ(view.phase, UnitPhase::kReady) << when;
      EXPECT_TRUE(stopped || IsPlace(view.knowledge)) << when;
      ExpectStoreTellsTheTruth(fleet, when);
    }
  }
}

TEST(Configuration, KilledAnywhereTheStoreTellsTheTruthAndItCanBeCompleted) {
  int unproven = 0;
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    FOCALFLEET_TRACE_SEED(seed);
    InProcessFleet fleet({.count = 19, .seed = seed});
    Rng rng = Rng::Stream(seed, "kill");
    fleet.ApplyRandom(seed);
    fleet.Run(Milliseconds(static_cast<std::int64_t>(rng.Uniform(0, 40'000))));
    const bool cut = rng.Uniform() < 0.5;
    const UnitId victim = fleet.id(static_cast<std::uint32_t>(rng.Below(19)));
    if (cut) fleet.world().disturb().PowerCut(victim);
    fleet.Restart();
    if (cut) {
      fleet.Run(Milliseconds(static_cast<std::int64_t>(rng.Uniform(0, 5000))));
      fleet.world().disturb().PowerOn(victim);
    }
    fleet.Run(Seconds(120));
    ExpectStoreTellsTheTruth(fleet, "after the kill");
    std::vector<PositionerIndex> lost;
    for (std::uint32_t n = 0; n < 19; ++n) {
      const UnitView& view = fleet.coordinator().unit({n});
      EXPECT_EQ(view.phase, UnitPhase::kReady) << n;
      if (IsPlace(view.knowledge)) continue;
      EXPECT_TRUE(cut && fleet.id(n) == victim) << "row " << n << " lost power? no";
      lost.push_back({n});
    }
    if (!lost.empty()) {
      fleet.Send({903, HomeCommand{lost}});
      ASSERT_TRUE(fleet.RunUntilIdle());
      // With the coordinator dead no unit was kept away from it: a neighbour may stand inside its
      // interval. No way home can be proven then. The coordinator reports that and leaves the
      // decision to the operator.
      if (CountOutcome(fleet, TargetOutcome::kArrived) != lost.size()) {
        ++unproven;
        fleet.Send({904, HomeCommand{lost, true}});
        ASSERT_TRUE(fleet.RunUntilIdle());
      }
      EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), lost.size()) << Unserved(fleet);
    }
    fleet.ApplyRandom(seed);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOthersArrive(&fleet, 0);
  }
  EXPECT_LE(unproven, 10);
}

// The power of a moving unit is cut, and its mark is lost with it. The run that reads the restart
// is killed before it has stored what follows.
TEST(Configuration, ARestartIsReportedUntilWhatFollowsIsStored) {
  InProcessFleet fleet(Small(48));
  fleet.ApplyRandom(48);
  RunIntoMotion(&fleet, Seconds(2));
  const PositionerIndex i = SomebodyMoving(&fleet);
  fleet.Restart();
  fleet.Run(Milliseconds(100));
  fleet.world().disturb().PowerCut(fleet.id(i.value));
  fleet.world().disturb().SpoilFlash(fleet.id(i.value), sim::FlashDamage::kNoMark);
  fleet.Restart();
  fleet.storage.fails = true;  // nothing of this run is stored
  fleet.world().disturb().PowerOn(fleet.id(i.value));
  fleet.Run(Seconds(5));
  EXPECT_EQ(fleet.coordinator().unit(i).knowledge[0].witness, Witness::kInterval);
  EXPECT_EQ(fleet.coordinator().unit(i).phase, UnitPhase::kIdentifying) << "not resumed yet";
  fleet.storage.fails = false;
  fleet.Restart();
  fleet.Run(Seconds(90));
  EXPECT_EQ(fleet.coordinator().unit(i).knowledge[0].witness, Witness::kInterval);
  EXPECT_EQ(fleet.coordinator().unit(i).phase, UnitPhase::kReady);
  ExpectStoreTellsTheTruth(fleet, "after the second run");
}

// Hardware with an open move answers at another place. Whether it has restarted is asked when it is
// adopted or put back, so it goes on saying so, and that alone is no news.
TEST(Configuration, ForeignHardwareWithAnOpenMoveIsReadOnce) {
  InProcessFleet fleet(Small(51));
  fleet.ApplyRandom(51);
  RunIntoMotion(&fleet, Seconds(1));
  const PositionerIndex i = SomebodyMoving(&fleet);
  const PositionerIndex other{i.value == 0 ? 1u : 0u};
  fleet.world().disturb().PowerCut(fleet.id(i.value));
  fleet.Run(Seconds(60));
  ASSERT_EQ(fleet.coordinator().unit(i).phase, UnitPhase::kSilent);
  fleet.world().disturb().faults(fleet.id(other.value))->foreign_serial =
      fleet.coordinator().unit(i).bound_serial;
  fleet.world().disturb().PowerCut(fleet.id(other.value));
  fleet.Run(Seconds(1));
  fleet.world().disturb().PowerOn(fleet.id(other.value));
  fleet.Run(Seconds(15));
  ASSERT_EQ(fleet.coordinator().unit(other).phase, UnitPhase::kForeign);
  std::vector<OutFrame> sent;
  fleet.sent = &sent;
  fleet.Run(Seconds(60));
  const auto asked = std::ranges::count_if(sent, [&](const OutFrame& frame) {
    const auto message = DecodeHost(frame.frame);
    return message && std::holds_alternative<IdentifyRequest>(message->message) &&
           message->address.node == fleet.layout().unit(other).node &&
           frame.bus == fleet.layout().unit(other).bus;
  });
  EXPECT_EQ(asked, 0) << "its identity is known";
}

// The plan of units that an earlier run has sent off is gone: where one ends early, those near it
// stop. A unit may end before the next run has heard it, and then be silent.
TEST(Configuration, UnitsOfAnEarlierRunStopForOneThatEndsEarly) {
  struct Case {
    bool silent;
    bool before;  // it ends before the run begins
    const char* what;
  };
  for (const auto& [silent, before, what] :
       {Case{false, false, " has ended early"}, Case{true, false, " is not heard"},
        Case{true, true, " does not answer"}}) {
    InProcessFleet fleet(Small(49));
    fleet.ApplyRandom(49);
    RunIntoMotion(&fleet, Seconds(1));
    const PositionerIndex first = SomebodyMoving(&fleet);
    if (before) fleet.world().disturb().PowerCut(fleet.id(first.value));
    fleet.Restart();
    fleet.Run(Milliseconds(200));  // all that answer have been read
    std::vector<std::size_t> near;
    for (const PositionerIndex j : fleet.layout().neighbours(first))
      if (fleet.world().Truth(std::size_t{j.value}).state == UnitState::kMoving)
        near.push_back(j.value);
    ASSERT_GE(near.size(), 2u) << "nobody moves near it";
    if (silent && !before)
      fleet.world().disturb().PowerCut(fleet.id(first.value));
    else if (!silent)
      fleet.world().disturb().RaiseFault(fleet.id(first.value), FaultCode::kDriver);
    fleet.Run(before ? Seconds(2) : Milliseconds(1100));
    for (const std::size_t n : near)
      EXPECT_NE(fleet.world().Truth(n).state, UnitState::kMoving) << "row " << n << what;
    EXPECT_TRUE(HasAlarm(fleet, "unit " + std::to_string(fleet.id(first.value).value) + what));
    fleet.world().disturb().PowerOn(fleet.id(first.value));
    fleet.Run(Seconds(90));
    ExpectStoreTellsTheTruth(fleet, "at the end");
  }
}

TEST(Configuration, TheOneThatTheDaemonDidNotEndHasFailed) {
  for (const bool asked : {false, true}) {  // kill -9, SIGTERM
    InProcessFleet fleet(Small(47));
    fleet.ApplyRandom(47);
    RunIntoMotion(&fleet, Seconds(2));
    fleet.Run(Milliseconds(50));
    ASSERT_EQ(fleet.store().configurations.back().state, ConfigurationState::kMoving);
    if (asked) {
      fleet.End();
      EXPECT_EQ(fleet.store().configurations.back().state, ConfigurationState::kFailed);
    }
    fleet.Restart();
    fleet.Run(Milliseconds(100));
    const ConfigurationRow& row = fleet.store().configurations.back();
    EXPECT_EQ(row.state, ConfigurationState::kFailed);
    EXPECT_EQ(row.counts.targeted, 37u);
    EXPECT_TRUE(HasAlarm(fleet, "configuration 1 has failed: the daemon ended"));
    EXPECT_EQ(fleet.store().alarms.size(), 1u) << "said once";
    EXPECT_EQ(fleet.coordinator().configuration().id, 1u);
    EXPECT_EQ(fleet.coordinator().configuration().state, ConfigurationState::kFailed);
    EXPECT_EQ(fleet.coordinator().configuration().source, "test");
    fleet.Run(Seconds(90));
    fleet.ApplyRandom(47);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(fleet.coordinator().configuration().id, 2u);
    ExpectOthersArrive(&fleet, 0);
  }
}

}  // namespace
}  // namespace focalfleet
