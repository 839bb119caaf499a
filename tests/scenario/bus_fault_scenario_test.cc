// These tests run configurations while a bus is disturbed by the standard's rules: noise, a
// babbling unit, a wire stuck dominant, the host's controller off. Units end in a truthful state,
// and all others arrive. When the disturbance is over the bus' units are served again.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/scenario/in_process_fleet.h"
#include "tests/scenario/steps.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::CountOutcome;
using test::ExpectStoreTellsTheTruth;
using test::InProcessFleet;
using test::TestSeed;

constexpr std::uint32_t kUnits = 37;

bool HasAlarm(InProcessFleet* fleet, const std::string& part) {
  return std::ranges::any_of(fleet->store().alarms, [&](const AlarmRow& alarm) {
    return alarm.text.find(part) != std::string::npos;
  });
}

/// The condition of the bus' alarm has ended.
bool HasEnded(InProcessFleet* fleet, AlarmName name, BusId bus) {
  return std::ranges::any_of(fleet->store().alarm_ends, [&](const AlarmEndRow& end) {
    return end.name == name && end.bus == bus;
  });
}

std::uint64_t ErrorFrames(InProcessFleet* fleet) {
  std::uint64_t sum = 0;
  for (const BusId bus : fleet->layout().buses())
    sum += fleet->world().counters(bus).wire.error_frames();
  return sum;
}

// Expects that no knowledge is wrong, and that each unit outside `sick` has arrived.
void ExpectOnlyTheSickBusSuffers(InProcessFleet* fleet, BusId sick) {
  fleet->Run(Milliseconds(100));  // the last batch becomes durable
  ExpectStoreTellsTheTruth(*fleet, "at the end");
  for (std::uint32_t n = 0; n < kUnits; ++n) {
    const UnitView& view = fleet->coordinator().unit({n});
    if (fleet->layout().units()[n].bus == sick) {
      EXPECT_NE(view.outcome, TargetOutcome::kPending) << n;
      continue;
    }
    // Where a unit of the sick bus stands in the way, a refusal with its reason is the truth.
    EXPECT_TRUE(view.outcome == TargetOutcome::kArrived || view.outcome == TargetOutcome::kRefused)
        << n << " " << view.outcome_reason;
  }
}

void ExpectAllArriveNow(InProcessFleet* fleet, std::uint64_t seed) {
  fleet->Run(Seconds(15));
  fleet->ApplyRandom(seed);
  ASSERT_TRUE(fleet->RunUntilIdle());
  fleet->Run(Milliseconds(100));
  for (std::uint32_t n = 0; n < kUnits; ++n) {
    const UnitView& view = fleet->coordinator().unit({n});
    EXPECT_EQ(view.outcome, TargetOutcome::kArrived)
        << "unit " << fleet->id(n).value << " " << Name(view.phase) << " " << view.outcome_reason;
  }
  ExpectStoreTellsTheTruth(*fleet, "after all");
}

TEST(BusFaults, NoiseCostsTimeAndNoUnit) {
  for (const double rate : {1e-5, 1e-4}) {
    SCOPED_TRACE(rate);
    InProcessFleet fleet({.count = kUnits, .seed = 31});
    for (const BusId bus : fleet.layout().buses())
      fleet.world().disturb().faults(bus)->bit_error_rate = rate;
    fleet.ApplyRandom(31);
    ASSERT_TRUE(fleet.RunUntilIdle());
    EXPECT_EQ(CountOutcome(fleet, TargetOutcome::kArrived), kUnits);
    EXPECT_EQ(fleet.coordinator().configuration().round, 1u);
    fleet.Run(Milliseconds(100));
    ExpectStoreTellsTheTruth(fleet, "at the end");
    std::uint64_t frames = 0;
    for (const BusId bus : fleet.layout().buses())
      frames += fleet.world().counters(bus).host_frames + fleet.world().counters(bus).unit_frames;
    const double expected = static_cast<double>(frames) * 130 * rate;
    EXPECT_NEAR(static_cast<double>(ErrorFrames(&fleet)), expected, 5 * std::sqrt(expected) + 5);
  }
}

TEST(BusFaults, ABabblingUnitTakesOnlyItsBus) {
  InProcessFleet fleet({.count = kUnits, .seed = 32});
  fleet.Run(Seconds(2));
  const BusId sick = fleet.layout().buses()[1];
  const UnitId babbler = std::ranges::find(fleet.layout().units(), sick, &Unit::bus)->id;
  fleet.ApplyRandom(32);
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kUploading; },
      Seconds(60)));
  CanFrame babble{1u << 26 | 63u << 20 | 1u << 19, 8, {}};
  fleet.world().disturb().Babble(babbler, babble);
  ASSERT_TRUE(fleet.RunUntilIdle());
  EXPECT_GT(fleet.world().counters(sick).babbled, 10'000u);
  ExpectOnlyTheSickBusSuffers(&fleet, sick);
  EXPECT_GT(CountOutcome(fleet, TargetOutcome::kFailed), 5u) << "nothing below passed";
  fleet.world().disturb().Babble(babbler, std::nullopt);
  ExpectAllArriveNow(&fleet, 33);
}

TEST(BusFaults, BusOffInMidMotionIsReportedWithItsCauseAndTheBusComesBack) {
  InProcessFleet fleet({.count = kUnits, .seed = 34});
  fleet.Run(Seconds(2));
  const BusId sick = fleet.layout().buses()[2];
  fleet.ApplyRandom(34);
  ASSERT_TRUE(fleet.RunUntil(
      [&] { return fleet.coordinator().configuration().state == ConfigurationState::kMoving; },
      Seconds(60)));
  fleet.Run(Seconds(1));
  // Hardly a frame survives on this bus; the controllers' error counters do the rest.
  fleet.world().disturb().faults(sick)->bit_error_rate = 0.05;
  const auto state = [&] { return fleet.coordinator().bus(sick).link; };
  ASSERT_TRUE(fleet.RunUntil([&] { return state() == LinkState::kPassive; }, Seconds(20)));
  ASSERT_TRUE(fleet.RunUntil([&] { return state() == LinkState::kOff; }, Seconds(20)));
  fleet.Run(Milliseconds(20));  // the row becomes durable
  const std::string name = "bus " + std::to_string(sick.value);
  for (const std::string& part :
       {name + ": the controller warns of errors (", name + " is passive: the controller is error-",
        name + " is off: the controller is bus-off ("})
    EXPECT_TRUE(HasAlarm(&fleet, part)) << part;
  fleet.Run(Milliseconds(500));
  EXPECT_EQ(state(), LinkState::kOff) << "restarted after a second";
  EXPECT_FALSE(HasEnded(&fleet, AlarmName::kBusDown, sick));
  fleet.world().disturb().faults(sick)->bit_error_rate = 0;
  ASSERT_TRUE(fleet.RunUntil([&] { return state() == LinkState::kUp; }, Seconds(2)));
  ASSERT_TRUE(fleet.RunUntilIdle());
  ExpectOnlyTheSickBusSuffers(&fleet, sick);
  EXPECT_TRUE(HasEnded(&fleet, AlarmName::kBusDown, sick)) << "the bus is up again";
  EXPECT_TRUE(HasEnded(&fleet, AlarmName::kBusPassive, sick));
  ExpectAllArriveNow(&fleet, 35);
}

TEST(BusFaults, AWireStuckDominantLosesItsUnitsAndNoTruth) {
  const std::uint64_t seed = TestSeed(36);
  FOCALFLEET_TRACE_SEED(seed);
  for (std::uint64_t run = seed; run < seed + 3; ++run) {
    InProcessFleet fleet({.count = kUnits, .seed = run});
    const BusId sick = fleet.layout().buses()[0];
    fleet.ApplyRandom(run);
    fleet.Run(Milliseconds(static_cast<std::int64_t>(1900 + 300 * (run - seed))));
    fleet.world().disturb().StickBus(sick);
    fleet.Run(Seconds(8));
    EXPECT_NE(fleet.world().controller(sick).state, sim::Confinement::kActive);
    fleet.world().disturb().ReleaseBus(sick);
    ASSERT_TRUE(fleet.RunUntilIdle());
    ExpectOnlyTheSickBusSuffers(&fleet, sick);
    ExpectAllArriveNow(&fleet, run + 100);
  }
}

// The same disturbance by the clock of a plan: two runs of one seed are equal.
TEST(BusFaults, APlanOfFaultsGivesTheSameRunTwice) {
  const auto run = [](std::uint64_t seed) {
    InProcessFleet::Options options{.count = kUnits, .seed = seed};
    options.faults = {
        {.kind = sim::FaultKind::kNoise, .bus = {0}, .from = Seconds(1), .chance = 1e-4},
        {.kind = sim::FaultKind::kHostOff, .bus = {1}, .from = Seconds(3), .to = Seconds(4)},
        {.kind = sim::FaultKind::kUnplugged, .unit = {3}, .from = Seconds(2), .to = Seconds(6)},
        {.kind = sim::FaultKind::kDuplicate, .bus = {2}, .chance = 0.02},
        {.kind = sim::FaultKind::kDelay, .bus = {2}, .chance = 0.02, .value = 0.003}};
    InProcessFleet fleet(options);
    fleet.Run(Milliseconds(900));
    fleet.ApplyRandom(seed);
    EXPECT_TRUE(fleet.RunUntilIdle());
    fleet.Run(Milliseconds(100));
    ExpectStoreTellsTheTruth(fleet, "at the end");
    EXPECT_GT(fleet.world().counters({0}).wire.error_frames(), 0u);
    EXPECT_EQ(fleet.world().counters({1}).controllers.went_off, 1u);
    EXPECT_GT(fleet.world().counters({2}).received_twice, 0u);
    return fleet.digest();
  };
  const std::uint64_t first = run(40);
  EXPECT_EQ(first, run(40));
  EXPECT_NE(first, run(41));
}

}  // namespace
}  // namespace focalfleet
