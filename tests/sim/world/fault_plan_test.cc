#include "sim/world/fault_plan.h"

#include <gtest/gtest.h>

#include "tests/sim/world/rig.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::FleetOf;
using test::Rig;

TEST(FaultPlan, EveryFaultEndsAsItBegan) {
  WorldConfig config = FleetOf(1, 4);
  const DurationNs from = Milliseconds(100);
  const DurationNs to = Milliseconds(200);
  config.faults = {{.kind = FaultKind::kBabble, .unit = {3}, .from = from, .to = to, .value = 1},
                   {.kind = FaultKind::kSilent, .unit = {1}, .from = from, .to = to},
                   {.kind = FaultKind::kPowerCut, .unit = {2}, .from = from, .to = to},
                   {.kind = FaultKind::kNoise, .bus = {0}, .from = from, .to = to, .chance = 1e-3}};
  ASSERT_TRUE(World::Validate(config));
  Rig rig(config);
  rig.Run(Milliseconds(100) - DurationNs{1});
  EXPECT_EQ(rig.world().counters({0}).babbled, 0u);
  EXPECT_TRUE(rig.world().Truth(UnitId{2}).powered);
  rig.Run(DurationNs{1});
  EXPECT_TRUE(rig.world().disturb().faults(UnitId{1})->silent);
  EXPECT_FALSE(rig.world().Truth(UnitId{2}).powered);
  EXPECT_EQ(rig.world().disturb().faults(BusId{0})->bit_error_rate, 1e-3);
  rig.Run(Milliseconds(900));
  EXPECT_FALSE(rig.world().disturb().faults(UnitId{1})->silent);
  EXPECT_TRUE(rig.world().Truth(UnitId{2}).powered);
  EXPECT_EQ(rig.world().disturb().faults(BusId{0})->bit_error_rate, 0);
  const BusCounters counters = rig.world().counters({0});
  EXPECT_GT(counters.babbled, 500u);
  EXPECT_LT(counters.wire.busy.ns, Milliseconds(101).ns) << "100 ms of babble, and nothing after";
  EXPECT_EQ(rig.world().NextEvent().ns > Seconds(1).ns, true);
}

TEST(FaultPlan, ChanceHitsItsShareOfTheUnitsAndTheSameOnesForOneSeed) {
  const std::uint64_t seed = focalfleet::test::TestSeed(71);
  FOCALFLEET_TRACE_SEED(seed);
  const auto silent = [](std::uint64_t of) {
    WorldConfig config = FleetOf(10, 100);
    config.seed = of;
    for (const UnitDescription& unit : config.units)
      config.faults.push_back({.kind = FaultKind::kSilent, .unit = unit.id, .chance = 0.1});
    World world(config);
    std::vector<std::uint32_t> hit;
    for (const UnitDescription& unit : world.units())
      if (world.disturb().faults(unit.id)->silent) hit.push_back(unit.id.value);
    return hit;
  };
  EXPECT_NEAR(static_cast<double>(silent(seed).size()), 100, 5 * 9.5);
  EXPECT_EQ(silent(seed), silent(seed));
  EXPECT_NE(silent(seed), silent(seed + 1));
}

TEST(FaultPlan, WhatCannotBeIsRefused) {
  const auto refuses = [](const PlannedFault& fault, bool bit_clock = true) {
    WorldConfig config = FleetOf(1, 2);
    config.bit_clock = bit_clock;
    config.faults = {fault};
    return !World::Validate(config);
  };
  EXPECT_FALSE(refuses({.kind = FaultKind::kStuck, .bus = {0}}));
  EXPECT_TRUE(refuses({.kind = FaultKind::kStuck, .bus = {0}}, false));
  EXPECT_TRUE(refuses({.kind = FaultKind::kStuck, .bus = {1}}));
  EXPECT_TRUE(refuses({.kind = FaultKind::kDeaf, .unit = {9}}));
  EXPECT_TRUE(
      refuses({.kind = FaultKind::kDeaf, .unit = {1}, .from = Seconds(2), .to = Seconds(2)}));
  EXPECT_TRUE(refuses({.kind = FaultKind::kDrop, .bus = {0}, .chance = 1.1}));
  EXPECT_TRUE(refuses({.kind = FaultKind::kCopies, .unit = {1}, .value = 0}));
}

}  // namespace
}  // namespace focalfleet::sim
