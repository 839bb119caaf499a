// Dense plates: every arm reaches over its neighbours' bases.
#include <algorithm>
#include <array>

#include "fleet/plan/candidates.h"
#include "fleet/plan/pair_bound.h"
#include "fleet/plan/power_statement.h"
#include "fleet/plan/scene.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using namespace test;

PlanningFleet DenseFleet(std::uint64_t seed) {
  PlanningFleet fleet = FleetOf(MakeHexLayout(SdssLike(91)));
  DrawStartAndTargets(&fleet, Seed(seed));
  return fleet;
}

void ExpectClear(const PlanningFleet& fleet, const Plan& plan) {
  CheckOptions options;
  options.clearance_mm = fleet.layout.clearance_mm();
  const auto report = CheckPlan(CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
                                CheckedRows(plan, fleet.layout, fleet.drives),
                                CheckedObstacles(fleet.layout), options);
  EXPECT_TRUE(report.ok()) << report.Text();
}

TEST(DensePlan, ServesAllSoonAndNeverBelowTheBoundOfAnyPair) {
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    const PlanningFleet fleet = DenseFleet(seed);
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty());
    ExpectClear(fleet, *plan);
    EXPECT_LE(plan->makespan_s, 1.6 * plan->bound_s);
    EXPECT_GE(plan->pair_bound_s, plan->bound_s);
    EXPECT_GE(plan->makespan_s, plan->pair_bound_s);
    // The bound of a pair holds for the ways of that pair in every plan.
    const Scene scene(fleet.layout, fleet.drives, fleet.start);
    std::vector<double> end_s(scene.size(), 0);
    for (const UnitPlan& move : plan->moves)
      end_s[move.unit.value] = EndOf(move, fleet.drives[move.unit.value]);
    for (std::uint32_t i = 0; i < scene.size(); i += 5) {
      const std::uint32_t j = scene.neighbours(i).front().unit;
      const auto member = [&](std::uint32_t unit) {
        return PairBound::Member{&scene.arm(unit), &fleet.drives[unit], PlaceOf(fleet.start[unit]),
                                 *fleet.targets[unit]};
      };
      PairBound pair({member(i), member(j)}, scene.FullNeed(i, j) - kClearToleranceMm);
      EXPECT_LE(pair.Find(0, 3000), std::max(end_s[i], end_s[j]) + 1e-6) << i << " and " << j;
    }
  }
}

/// A dense plate of which 15 of 100 units stand for good where they start, in any pose.
PlanningFleet BrokenFleet(std::uint64_t seed) {
  PlanningFleet fleet = FleetOf(MakeHexLayout(SdssLike(169)));
  Rng lot = Rng::Stream(Seed(seed), "broken");
  for (std::uint8_t& frozen : fleet.frozen) frozen = lot.Below(100) < 15 ? 1 : 0;
  DrawStartAndTargets(&fleet, Seed(seed));
  return fleet;
}

/// Units that the broken ones wall in are given up, and the others do not wait for them.
TEST(DensePlan, GoesAroundUnitsThatStandForGood) {
  std::ptrdiff_t unproven = 0;
  for (const std::uint64_t seed : {900u, 901u, 904u}) {
    const PlanningFleet fleet = BrokenFleet(seed);
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    ExpectClear(fleet, *plan);
    unproven += std::ranges::count_if(plan->unserved, [](const Unserved& unserved) {
      return unserved.why == UnservedWhy::kBlocked && !unserved.proof;
    });
    EXPECT_LE(plan->makespan_s, 1.5 * plan->bound_s) << "seed " << Seed(seed);
  }
  EXPECT_LE(unproven, 1);
}

TEST(DensePlan, IsTheSameBitForBitAndNeverWorseWithWork) {
  const PlanningFleet fleet = DenseFleet(3);
  const auto first = MakePlan(fleet.request(), {.improve_cpu_s = 0});
  const auto improved = MakePlan(fleet.request(), {.improve_cpu_s = 0.3});
  const auto again = MakePlan(fleet.request(), {.improve_cpu_s = 0.3});
  ASSERT_TRUE(first && improved && again);
  EXPECT_LE(improved->makespan_s, first->makespan_s);
  ASSERT_EQ(improved->moves.size(), again->moves.size());
  for (std::size_t m = 0; m < again->moves.size(); ++m)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      EXPECT_TRUE(std::ranges::equal(improved->moves[m].path[k].segments(),
                                     again->moves[m].path[k].segments()));
}

TEST(DensePlan, KeepsALimitOfHalfTheFreePeak) {
  const PlanningFleet fleet = DenseFleet(4);
  const auto free = MakePlan(fleet.request(), {});
  ASSERT_TRUE(free);
  PlanOptions options;
  options.power.rail_W = StatePower(*free, fleet.layout, fleet.drives, options).LargestRail_W() / 2;
  const auto plan = MakePlan(fleet.request(), options);
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
  ExpectClear(fleet, *plan);
  EXPECT_LE(StatePower(*plan, fleet.layout, fleet.drives, options).LargestRail_W(),
            options.power.rail_W + 1e-9);
}

/// Two units of a dense plate that are hooked into each other at the target.
TEST(PairBound, KnowsThatOneMustMakeWayForTheOther) {
  const PlanningFleet fleet = FleetOf(MakeHexLayout(SdssLike(500)));
  const std::vector<std::optional<Pose>> free(fleet.layout.size());
  const auto from = DrawConfiguration(fleet.layout, fleet.drives, free, Rng(4));
  const auto to = DrawConfiguration(fleet.layout, fleet.drives, free, Rng(504));
  ASSERT_TRUE(from && to);
  const Scene scene(fleet.layout, fleet.drives, fleet.start);
  std::array<PairBound::Member, 2> members;
  double alone_s = 0;
  for (std::size_t m = 0; m < 2; ++m) {
    const std::uint32_t i = fleet.layout.Find(UnitId{m == 0 ? 188u : 224u})->value;
    members[m] = {&scene.arm(i), &fleet.drives[i], (*from)[i], (*to)[i]};
    alone_s = std::max(alone_s, Straight(fleet.drives[i], (*from)[i], (*to)[i]).end_s);
  }
  PairBound apart(members, 0);
  EXPECT_LE(apart.Find(0, 20'000), alone_s + 1e-6) << "nothing is in the way";
  PairBound pair(members, 2 * scene.arm(0).half_width_mm() + fleet.layout.clearance_mm());
  EXPECT_GT(pair.Find(alone_s, 50'000), 1.03 * alone_s);
}

}  // namespace
}  // namespace focalfleet
