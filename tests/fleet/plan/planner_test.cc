#include "fleet/plan/planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using ::focalfleet::testing::CheckedRow;
using ::focalfleet::testing::CheckOptions;
using ::focalfleet::testing::DrawStartAndTargets;
using ::focalfleet::testing::ExpectSound;
using ::focalfleet::testing::FleetOf;
using ::focalfleet::testing::HexFleet;
using ::focalfleet::testing::MoveOf;
using ::focalfleet::testing::PlanningFleet;
using ::focalfleet::testing::PoseDeg;
using ::focalfleet::testing::TestSeed;
using ::focalfleet::testing::UnitAt;
using ::testing::HasSubstr;

/// Two arms side by side between the bases, each below or above the other so that folding back (phi
/// grows, the tip turns counter-clockwise) runs into the other one.
PlanningFleet YinYang(double left_theta_zero_deg = 0) {
  PlanningFleet fleet = FleetOf({UnitAt(1, 0, left_theta_zero_deg), UnitAt(2, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, -20 - left_theta_zero_deg, 20), PoseDeg(fleet, 1, 160, 20)});
  return fleet;
}

std::uint64_t Seed(std::uint64_t k) { return TestSeed(1000 + k); }

TEST(Planner, ServesEveryUnitOfSmallHexagonalFleets) {
  for (const std::uint32_t count : {7u, 19u, 61u, 127u}) {
    PlanningFleet fleet = HexFleet(count);
    for (std::uint64_t k = 0; k < 12; ++k) {
      FOCALFLEET_TRACE_SEED(Seed(k));
      DrawStartAndTargets(&fleet, Seed(k));
      const auto plan = MakePlan(fleet.request(), {});
      ASSERT_TRUE(plan) << plan.error().text;
      EXPECT_TRUE(plan->unserved.empty());
      ExpectSound(fleet, *plan);
    }
  }
}

TEST(Planner, FoldsAFleetAndUnfoldsItAgain) {
  PlanningFleet fleet = HexFleet(61);
  FOCALFLEET_TRACE_SEED(Seed(0));
  DrawStartAndTargets(&fleet, Seed(0));
  const std::vector<Pose> folded = FoldedConfiguration(fleet.layout, fleet.drives);
  PlanningFleet in = fleet;
  PlanningFleet out = fleet;
  out.StandAt(folded);
  for (std::size_t i = 0; i < folded.size(); ++i) in.targets[i] = folded[i];
  for (const PlanningFleet* way : {&in, &out}) {
    const auto plan = MakePlan(way->request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty());
    ExpectSound(*way, *plan);
  }
}

TEST(Planner, SameRequestGivesTheSamePlan) {
  PlanningFleet fleet = HexFleet(61);
  FOCALFLEET_TRACE_SEED(Seed(3));
  DrawStartAndTargets(&fleet, Seed(3));
  const auto first = MakePlan(fleet.request(), {});
  const auto second = MakePlan(fleet.request(), {});
  ASSERT_TRUE(first && second);
  ASSERT_EQ(first->moves.size(), second->moves.size());
  for (std::size_t m = 0; m < first->moves.size(); ++m)
    for (std::size_t k = 0; k < kAxisCount; ++k)
      EXPECT_TRUE(std::ranges::equal(first->moves[m].path[k].segments(),
                                     second->moves[m].path[k].segments()));
}

TEST(Planner, NothingMovesWhereNothingIsAsked) {
  PlanningFleet fleet = HexFleet(19);
  FOCALFLEET_TRACE_SEED(Seed(1));
  DrawStartAndTargets(&fleet, Seed(1));
  fleet.targets.assign(fleet.targets.size(), std::nullopt);
  fleet.targets[4] = PlaceOf(fleet.start[4]);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->moves.empty());
  EXPECT_TRUE(plan->unserved.empty());
  EXPECT_EQ(plan->makespan_s, 0);
}

TEST(Planner, FreesTwoArmsThatLockEachOther) {
  PlanningFleet fleet = YinYang();
  fleet.targets = {PoseDeg(fleet, 0, 100, 90), PoseDeg(fleet, 1, -100, 90)};
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
  ExpectSound(fleet, *plan);
  // And into the lock again.
  PlanningFleet back = fleet;
  back.StandAt({*fleet.targets[0], *fleet.targets[1]});
  back.targets = {PlaceOf(fleet.start[0]), PlaceOf(fleet.start[1])};
  const auto return_plan = MakePlan(back.request(), {});
  ASSERT_TRUE(return_plan) << return_plan.error().text;
  EXPECT_TRUE(return_plan->unserved.empty());
  ExpectSound(back, *return_plan);
}

/// The left unit stands at the lower end of theta: alone it cannot get out of the lock.
PlanningFleet LockedAtTheEndOfItsRange() {
  PlanningFleet fleet = YinYang(170);
  fleet.targets[0] = PoseDeg(fleet, 0, 0, 120);
  return fleet;
}

TEST(Planner, AnUnnamedUnitStepsAsideAndReturns) {
  const PlanningFleet fleet = LockedAtTheEndOfItsRange();
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
  ASSERT_NE(MoveOf(*plan, 1), nullptr);
  EXPECT_EQ(MoveOf(*plan, 1)->to, PlaceOf(fleet.start[1]));
  ExpectSound(fleet, *plan);
}

TEST(Planner, FixedForbidsSteppingAside) {
  const PlanningFleet fleet = LockedAtTheEndOfItsRange();
  const auto plan = MakePlan(fleet.request(), {.fixed = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->moves.empty());
  ASSERT_EQ(plan->unserved.size(), 1u);
  EXPECT_EQ(plan->unserved[0].unit.value, 0u);
  EXPECT_EQ(plan->unserved[0].why, UnservedWhy::kBlocked);
  EXPECT_EQ(plan->unserved[0].by, PositionerIndex{1});
}

TEST(Planner, UnnamedUnitsOfARandomFleetEndWhereTheyStood) {
  PlanningFleet fleet = HexFleet(61);
  for (std::uint64_t k = 0; k < 12; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    // Targets are drawn around those that stay.
    std::vector<std::optional<Pose>> standing(fleet.layout.size());
    const auto start =
        DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(Seed(k), "start"));
    ASSERT_TRUE(start);
    fleet.StandAt(*start);
    for (std::size_t i = 0; i < standing.size(); i += 2) standing[i] = (*start)[i];
    const auto target =
        DrawConfiguration(fleet.layout, fleet.drives, standing, Rng::Stream(Seed(k), "target"));
    ASSERT_TRUE(target) << target.error().text;
    for (std::size_t i = 1; i < standing.size(); i += 2) fleet.targets[i] = (*target)[i];
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty());
    ExpectSound(fleet, *plan);
    const auto fixed = MakePlan(fleet.request(), {.fixed = true});
    ASSERT_TRUE(fixed) << fixed.error().text;
    ExpectSound(fleet, *fixed);
    for (std::uint32_t i = 0; i < standing.size(); i += 2) EXPECT_EQ(MoveOf(*fixed, i), nullptr);
  }
}

TEST(Planner, KeepsClearOfFixedObstacles) {
  // Fiducials in the middle between three units, as on real plates.
  std::vector<Obstacle> fiducials;
  for (int ring = 0; ring < 6; ++ring) {
    const double angle = (30 + 60 * ring) * 3.14159265358979 / 180;
    const double radius = 25.6 / std::sqrt(3.0);
    fiducials.push_back({static_cast<std::uint32_t>(ring + 1),
                         {radius * std::cos(angle), radius * std::sin(angle)},
                         1.0});
  }
  PlanningFleet fleet = HexFleet(19, {.clearance_mm = 0, .obstacles = fiducials});
  for (std::uint64_t k = 0; k < 20; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    DrawStartAndTargets(&fleet, Seed(k));
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty());
    ExpectSound(fleet, *plan);
  }
}

TEST(Planner, PlansAroundUnitsThatStandAnywhere) {
  PlanningFleet fleet = HexFleet(61);
  std::size_t unserved = 0;
  std::size_t targeted = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    Rng rng = Rng::Stream(Seed(k), "frozen");
    for (std::uint8_t& f : fleet.frozen) f = rng.Uniform() < 0.15 ? 1 : 0;
    DrawStartAndTargets(&fleet, Seed(k));
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    ExpectSound(fleet, *plan);
    for (std::uint32_t i = 0; i < fleet.frozen.size(); ++i) {
      if (fleet.frozen[i] != 0) {
        EXPECT_EQ(MoveOf(*plan, i), nullptr);
      }
      targeted += fleet.targets[i] ? 1u : 0u;
    }
    unserved += plan->unserved.size();
  }
  // An arm frozen across a neighbour's way can shut it in for good; most are free.
  EXPECT_LT(static_cast<double>(unserved), 0.05 * static_cast<double>(targeted));
}

TEST(Planner, PassesOverDisabledAndUnknownUnitsByName) {
  auto units = MakeHexLayout({.count = 19});
  units[5].enabled = false;
  PlanningFleet fleet = FleetOf(units);
  FOCALFLEET_TRACE_SEED(Seed(2));
  DrawStartAndTargets(&fleet, Seed(2));
  fleet.targets[5] = PoseDeg(fleet, 5, 0, 170);
  fleet.start[18][1].witness = Witness::kUnknown;
  fleet.frozen[12] = 1;
  fleet.targets[12] = PoseDeg(fleet, 12, 0, 170);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  const auto why = [&](std::uint32_t unit) {
    for (const Unserved& u : plan->unserved)
      if (u.unit.value == unit) return u.why;
    ADD_FAILURE() << "unit index " << unit << " is not named";
    return UnservedWhy::kBlocked;
  };
  EXPECT_EQ(why(5), UnservedWhy::kDisabled);
  EXPECT_EQ(why(18), UnservedWhy::kUnknownPlace);
  EXPECT_EQ(why(12), UnservedWhy::kBlocked);
  EXPECT_TRUE(std::is_sorted(plan->unserved.begin(), plan->unserved.end(),
                             [](const auto& a, const auto& b) { return a.unit < b.unit; }));
}

TEST(Planner, KeepsClearOfEveryPlaceThatAnUncertainUnitMayHave) {
  PlanningFleet fleet = HexFleet(19);
  for (std::uint64_t k = 0; k < 8; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    DrawStartAndTargets(&fleet, Seed(k));
    // The unit in the middle was cut short somewhere on its way through its cell.
    const Pose low = PoseDeg(fleet, 0, -60, 130);
    const Pose high = PoseDeg(fleet, 0, 30, 175);
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      fleet.start[0][axis] = {Witness::kInterval, low[axis], high[axis]};
    const auto plan = MakePlan(fleet.request(), {});
    if (!plan) {
      // Nobody but certain places may be called colliding.
      EXPECT_THAT(plan.error().text, HasSubstr("apart"));
      continue;
    }
    EXPECT_EQ(MoveOf(*plan, 0), nullptr);
    Rng rng = Rng::Stream(Seed(k), "place");
    for (int draw = 0; draw < 20; ++draw) {
      PlanningFleet truth = fleet;
      truth.targets[0].reset();
      Pose pose{};
      for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
        const auto span = static_cast<std::uint64_t>(high[axis] - low[axis]) + 1;
        pose[axis] = low[axis] + static_cast<std::int32_t>(rng.Below(span));
      }
      truth.start[0] = Exactly(Witness::kReported, pose);
      // Neighbours that cannot be proven free of it must not have moved; they may stand inside.
      const auto report = focalfleet::testing::Witnessed(truth, *plan);
      for (const std::string& fault : report.faults) {
        if (!fault.starts_with("units ")) {
          ADD_FAILURE() << fault;
          continue;
        }
        const auto first = std::stoul(fault.substr(6));
        const auto second = std::stoul(fault.substr(fault.find(" and ") + 5));
        for (const auto id : {first, second}) {
          const auto index = truth.layout.Find(UnitId{static_cast<std::uint32_t>(id)});
          EXPECT_EQ(MoveOf(*plan, index->value), nullptr) << fault;
        }
      }
    }
  }
}

TEST(Planner, NamesEveryPairOfCollidingTargets) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 51.2)});
  fleet.StandAt(
      {PoseDeg(fleet, 0, 90, 170), PoseDeg(fleet, 1, 90, 170), PoseDeg(fleet, 2, 90, 170)});
  fleet.targets = {PoseDeg(fleet, 0, 0, 0), PoseDeg(fleet, 1, 180, 0), PoseDeg(fleet, 2, 180, 5)};
  fleet.targets[1] = PoseDeg(fleet, 1, 0, 0);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(plan.error().text, HasSubstr("22 and 33"));
  EXPECT_THAT(plan.error().text, ::testing::Not(HasSubstr("11")));
  EXPECT_THAT(plan.error().text, HasSubstr("4.4032 mm needed"));
  fleet.targets[1] = PoseDeg(fleet, 1, 180, 0);
  const auto other = MakePlan(fleet.request(), {});
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().text, HasSubstr("11 and 22"));
}

TEST(Planner, RefusesAStartThatCollides) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, 0, 0), PoseDeg(fleet, 1, 180, 0)});
  fleet.targets = {PoseDeg(fleet, 0, 90, 170), std::nullopt};
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kInvalid);
  EXPECT_THAT(plan.error().text, HasSubstr("the starts of units 11 and 22"));
}

TEST(Planner, LeadsApartWhatStartsTooNearWhenAskedTo) {
  // Two arms side by side, 0.8 mm nearer than allowed.
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, -12.5, 12.5), PoseDeg(fleet, 1, 167.5, 12.5)});
  fleet.targets = {PoseDeg(fleet, 0, 90, 120), PoseDeg(fleet, 1, -90, 120)};
  const auto refused = MakePlan(fleet.request(), {});
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text, HasSubstr("the starts of units 11 and 22"));
  const auto plan = MakePlan(fleet.request(), {.fixed = false, .lead_apart = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_THAT(plan->too_near, HasSubstr("11 and 22"));
  EXPECT_TRUE(plan->unserved.empty());
  // Never nearer than they start, by the checker's own distance.
  const auto before = focalfleet::testing::Witnessed(fleet, {});
  ASSERT_LT(before.worst_margin_mm, -0.1);
  CheckOptions options;
  options.tolerance_mm = -before.worst_margin_mm + 2e-4;
  ExpectSound(fleet, *plan, options);
}

TEST(Planner, SendsNobodyElseThroughItsCellBecauseTwoStartTooNear) {
  // The two of the test above, and one far away that has a degree to go.
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)});
  fleet.StandAt(
      {PoseDeg(fleet, 0, -12.5, 12.5), PoseDeg(fleet, 1, 167.5, 12.5), PoseDeg(fleet, 2, 10, 30)});
  fleet.targets = {PoseDeg(fleet, 0, 90, 120), PoseDeg(fleet, 1, -90, 120),
                   PoseDeg(fleet, 2, 9, 31)};
  const auto plan = MakePlan(fleet.request(), {.fixed = false, .lead_apart = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_THAT(plan->too_near, HasSubstr("11 and 22"));
  ASSERT_EQ(plan->moves.size(), 3u);
  for (const Axis axis : kAxes) EXPECT_EQ(plan->moves[2].path[Index(axis)].size(), 1u);
}

TEST(Planner, LeavesNobodyWhoMerelyStartsTooNear) {
  // The two of the tests above; whether both go, or the other stands and may not move.
  for (const bool frozen : {false, true}) {
    PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)});
    fleet.StandAt({PoseDeg(fleet, 0, -12.5, 12.5), PoseDeg(fleet, 1, 167.5, 12.5),
                   PoseDeg(fleet, 2, 10, 30)});
    fleet.targets = {PoseDeg(fleet, 0, 90, 120), PoseDeg(fleet, 1, -90, 120),
                     PoseDeg(fleet, 2, 9, 31)};
    fleet.frozen[1] = frozen ? 1 : 0;
    if (frozen) fleet.targets = {PoseDeg(fleet, 0, -90, 120), std::nullopt, fleet.targets[2]};
    const auto plan = MakePlan(fleet.request(), {.lead_apart = true, .leave_stuck = true});
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty()) << frozen;
    ASSERT_EQ(plan->moves.size(), frozen ? 2u : 3u);
    for (const Axis axis : kAxes) EXPECT_EQ(plan->moves.back().path[Index(axis)].size(), 1u);
  }
}

TEST(Planner, OfTwoTargetsThatMeetOneStaysWhereStuckOnesAreLeft) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)});
  fleet.StandAt(
      {PoseDeg(fleet, 0, 90, 120), PoseDeg(fleet, 1, -90, 120), PoseDeg(fleet, 2, 10, 30)});
  fleet.targets = {PoseDeg(fleet, 0, 0, 0), PoseDeg(fleet, 1, 180, 0), PoseDeg(fleet, 2, 9, 31)};
  EXPECT_FALSE(MakePlan(fleet.request(), {.lead_apart = true}));
  const auto plan = MakePlan(fleet.request(), {.lead_apart = true, .leave_stuck = true});
  ASSERT_TRUE(plan) << plan.error().text;
  ASSERT_EQ(plan->unserved.size(), 1u);
  EXPECT_EQ(plan->unserved[0].why, UnservedWhy::kTargetCollides);
  EXPECT_EQ(plan->moves.size(), 2u);
  ExpectSound(fleet, *plan, {});
}

TEST(Planner, TwoThatStandTooNearAndShallStayAreNoError) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)});
  fleet.StandAt(
      {PoseDeg(fleet, 0, -12.5, 12.5), PoseDeg(fleet, 1, 167.5, 12.5), PoseDeg(fleet, 2, 10, 30)});
  fleet.targets = {PoseDeg(fleet, 0, -12.5, 12.5), PoseDeg(fleet, 1, 167.5, 12.5),
                   PoseDeg(fleet, 2, 9, 31)};
  const auto plan = MakePlan(fleet.request(), {.lead_apart = true, .leave_stuck = true});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_EQ(plan->moves.size(), 1u);
}

TEST(Planner, LeavesWhoIsStuckWhenAskedToAndTheOthersGoStraight) {
  // Two arms across each other, and one far away that has a degree to go.
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)});
  fleet.StandAt({PoseDeg(fleet, 0, 0, 0), PoseDeg(fleet, 1, 180, 0), PoseDeg(fleet, 2, 10, 30)});
  fleet.targets = {PoseDeg(fleet, 0, 90, 120), PoseDeg(fleet, 1, -90, 120),
                   PoseDeg(fleet, 2, 9, 31)};
  const auto plan = MakePlan(fleet.request(), {.lead_apart = true, .leave_stuck = true});
  ASSERT_TRUE(plan) << plan.error().text;
  ASSERT_EQ(plan->unserved.size(), 2u);
  EXPECT_EQ(plan->unserved[0].why, UnservedWhy::kBlocked);
  ASSERT_EQ(plan->moves.size(), 1u);
  EXPECT_EQ(plan->moves[0].unit.value, 2u);
  for (const Axis axis : kAxes) EXPECT_EQ(plan->moves[0].path[Index(axis)].size(), 1u);
}

TEST(Planner, KeepsToTheRangeOfAUnitsOwnCount) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0)});
  fleet.StandAt({PoseDeg(fleet, 0, 90, 100)});
  fleet.targets = {PoseDeg(fleet, 0, 90, 178)};
  PlanRequest request = fleet.request();
  // It stands 3 degrees of phi less than it counts: 178 degrees would be 181 to it.
  const std::vector<Pose> less{PoseDeg(fleet, 0, 0, -3)};
  request.offsets = less;
  EXPECT_FALSE(MakePlan(request, {}));
  const std::vector<Pose> more{PoseDeg(fleet, 0, 0, 3)};
  request.offsets = more;
  EXPECT_TRUE(MakePlan(request, {}));
}

TEST(Planner, RefusesATargetOutOfRangeAndArraysOfTheWrongSize) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, 90, 170), PoseDeg(fleet, 1, 90, 170)});
  fleet.targets[0] = PoseDeg(fleet, 0, 0, 185);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_FALSE(plan);
  EXPECT_THAT(plan.error().text, HasSubstr("unit 11"));
  fleet.targets.pop_back();
  EXPECT_FALSE(MakePlan(fleet.request(), {}));
}

TEST(Planner, DropsATargetThatTouchesWhatCannotMove) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, 180, 170), PoseDeg(fleet, 1, 180, 0)});
  fleet.frozen[1] = 1;
  fleet.targets[0] = PoseDeg(fleet, 0, 0, 0);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  ASSERT_EQ(plan->unserved.size(), 1u);
  EXPECT_EQ(plan->unserved[0].why, UnservedWhy::kTargetCollides);
  EXPECT_EQ(plan->unserved[0].by, PositionerIndex{1});
  EXPECT_TRUE(plan->moves.empty());
}

TEST(Planner, ServesPairsThatAreClearByToleranceOnly) {
  // Two stretched arms tip to tip, 1.5 um nearer than half-widths and clearance: still clear by the
  // rule.
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 2 * 16.5 + 4.0)});
  const double need = 2 * 0.08 * 37.0 + 0.012 * 37.0;
  fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 37.0)});
  ASSERT_GT(need, 4.0);
  // Turn the right arm until the gap is just within the tolerance.
  Pose right = PoseDeg(fleet, 1, 180, 0);
  const Pose left = PoseDeg(fleet, 0, 0, 0);
  const auto gap = [&] {
    const double theta = right[0] * DegreesPerVector(fleet.layout.unit({1}).axis[0], {}) *
                         3.14159265358979323846 / 180;
    const double x = 37.0 + 16.5 * std::cos(theta) - 16.5;
    return std::hypot(x, 16.5 * std::sin(theta));
  };
  while (gap() < need - 0.002) ++right[0];
  ASSERT_LT(gap(), need);
  fleet.StandAt({left, right});
  fleet.targets = {PoseDeg(fleet, 0, 90, 90), PoseDeg(fleet, 1, 90, 90)};
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
  ExpectSound(fleet, *plan);
}

TEST(Planner, KeepsTheMarginsThatItIsAskedFor) {
  PlanningFleet fleet = HexFleet(127);
  FOCALFLEET_TRACE_SEED(Seed(5));
  DrawStartAndTargets(&fleet, Seed(5));
  const PlanOptions wide{.fixed = false, .start_skew_s = 3, .clock_error = 0.05};
  const auto plan = MakePlan(fleet.request(), wide);
  ASSERT_TRUE(plan) << plan.error().text;
  CheckOptions check;
  check.start_skew_s = wide.start_skew_s;
  check.clock_error = wide.clock_error;
  ExpectSound(fleet, *plan, check);
  // A plan for perfect clocks does not stand the same test: it is the margins that carry the first.
  const auto tight =
      MakePlan(fleet.request(), {.fixed = false, .start_skew_s = 0, .clock_error = 0});
  ASSERT_TRUE(tight);
  EXPECT_FALSE(focalfleet::testing::Witnessed(fleet, *tight, check).ok());
}

/// A unit ends early at `t_s`; its followers are stopped as late as UnitPlan::followers allows.
std::vector<CheckedRow> CutShort(const PlanningFleet& fleet, const Plan& plan, std::uint32_t unit,
                                 double t_s, bool heed_left) {
  std::vector<double> stops(fleet.layout.size(), 1e9);
  std::vector<std::uint32_t> open{unit};
  stops[unit] = t_s;
  while (!open.empty()) {
    const std::uint32_t i = open.back();
    open.pop_back();
    const UnitPlan* move = MoveOf(plan, i);
    if (move == nullptr) continue;
    for (const auto& follower : move->followers) {
      if (heed_left && follower.left_s <= stops[i]) continue;
      const double stop = std::max(follower.begins_s, stops[i]);
      if (stop >= stops[follower.unit.value]) continue;
      stops[follower.unit.value] = stop;
      open.push_back(follower.unit.value);
    }
  }
  std::vector<CheckedRow> rows;
  for (CheckedRow row : focalfleet::testing::CheckedRows(plan, fleet.layout, fleet.drives)) {
    const double stop = stops[fleet.layout.Find(UnitId{row.unit})->value];
    if (row.t0_s >= stop) continue;
    if (row.t1_s > stop) {
      row.to_deg =
          row.from_deg + (row.to_deg - row.from_deg) * (stop - row.t0_s) / (row.t1_s - row.t0_s);
      row.t1_s = stop;
    }
    rows.push_back(row);
  }
  return rows;
}

TEST(Planner, StoppingTheFollowersOfAUnitThatEndsEarlyKeepsAllClear) {
  PlanningFleet fleet = HexFleet(61);
  FOCALFLEET_TRACE_SEED(Seed(6));
  DrawStartAndTargets(&fleet, Seed(6));
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  CheckOptions options;
  options.clearance_mm = fleet.layout.clearance_mm();
  Rng rng = Rng::Stream(Seed(6), "cut");
  int touched_without = 0;
  for (int draw = 0; draw < 30; ++draw) {
    const auto unit = static_cast<std::uint32_t>(rng.Below(fleet.layout.size()));
    const double t_s = rng.Uniform(0, plan->makespan_s);
    for (const bool heed_left : {false, true}) {
      const auto rows = CutShort(fleet, *plan, unit, t_s, heed_left);
      const auto report = focalfleet::testing::CheckPlan(
          focalfleet::testing::CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
          rows, {}, options);
      EXPECT_TRUE(report.ok()) << "unit index " << unit << " ends at " << t_s << " s\n"
                               << report.Text();
    }
    Plan alone = *plan;
    for (UnitPlan& move : alone.moves) move.followers.clear();
    const auto rows = CutShort(fleet, alone, unit, t_s, false);
    touched_without +=
        focalfleet::testing::CheckPlan(focalfleet::testing::CheckedUnits(fleet.layout, fleet.drives,
                                                                         fleet.start, fleet.frozen),
                                       rows, {}, options)
                .ok()
            ? 0
            : 1;
  }
  EXPECT_GT(touched_without, 0) << "the stops made no difference, the test proves nothing";
}

TEST(Planner, DrivesOfDifferentSpeedsAreKeptApartToo) {
  PlanningFleet fleet = HexFleet(61);
  FOCALFLEET_TRACE_SEED(Seed(7));
  Rng rng = Rng::Stream(Seed(7), "speeds");
  for (UnitDrive& drive : fleet.drives)
    for (AxisDrive& axis : drive.axis) axis.repeat = static_cast<std::uint8_t>(40 + rng.Below(180));
  DrawStartAndTargets(&fleet, Seed(7));
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  EXPECT_TRUE(plan->unserved.empty());
  ExpectSound(fleet, *plan);
}

TEST(Planner, ArmsTooLongForTheirCellsNeverGiveACollidingPlan) {
  auto units = MakeHexLayout({.count = 19});
  for (Unit& unit : units) unit.axis[0].arm_mm = 11.5;
  PlanningFleet fleet = FleetOf(units);
  std::size_t served = 0;
  for (std::uint64_t k = 0; k < 4; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    DrawStartAndTargets(&fleet, Seed(k));
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    ExpectSound(fleet, *plan);
    served += fleet.layout.size() - plan->unserved.size();
  }
  EXPECT_GT(served, 0u) << "units without cells can still go by themselves";
}

TEST(MakeWayForHoming, SendsNeighboursOutOfTheArmsWay) {
  PlanningFleet fleet = HexFleet(19);
  int made_way = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    DrawStartAndTargets(&fleet, Seed(k));
    fleet.targets.assign(fleet.targets.size(), std::nullopt);
    const Pose somewhere = PlaceOf(fleet.start[0]);
    const std::int32_t spread = PoseDeg(fleet, 0, 3, 0)[0];
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      fleet.start[0][axis] = {Witness::kInterval, somewhere[axis] - spread,
                              somewhere[axis] + spread};
    const auto targets = MakeWayForHoming(fleet.request(), {0});
    ASSERT_TRUE(targets) << targets.error().text;
    ASSERT_EQ(targets->size(), fleet.layout.size());
    EXPECT_FALSE((*targets)[0]);
    // From anywhere in the interval: phi to the upper stop, then theta to the lower one.
    std::vector<CheckedRow> rows;
    PlanningFleet then = fleet;
    for (std::uint32_t i = 1; i < fleet.layout.size(); ++i) {
      if (!(*targets)[i]) continue;
      ++made_way;
      then.start[i] = Exactly(Witness::kReported, *(*targets)[i]);
    }
    for (const std::int32_t theta : {-spread, spread}) {
      const Pose from{somewhere[0] + theta, somewhere[1]};
      then.start[0] = Exactly(Witness::kReported, from);
      const auto units =
          focalfleet::testing::CheckedUnits(then.layout, then.drives, then.start, then.frozen);
      const auto& homing = units[0];
      rows = {{homing.id, 1, 0, 20, homing.axis[1].start_deg, homing.axis[1].max_deg},
              {homing.id, 0, 20, 60, homing.axis[0].start_deg, homing.axis[0].min_deg}};
      CheckOptions options;
      options.clearance_mm = fleet.layout.clearance_mm();
      const auto report = focalfleet::testing::CheckPlan(units, rows, {}, options);
      for (const std::string& fault : report.faults)
        EXPECT_EQ(fault.find("units " + std::to_string(homing.id) + " and"), std::string::npos)
            << fault;
    }
  }
  EXPECT_GT(made_way, 0);
}

TEST(MakeWayForHoming, RefusesByNameWhatCannotMove) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, 90, 20), PoseDeg(fleet, 1, 180, 0)});
  fleet.start[0][0] = {Witness::kInterval, PoseDeg(fleet, 0, 60, 0)[0],
                       PoseDeg(fleet, 0, 120, 0)[0]};
  const auto free = MakeWayForHoming(fleet.request(), {0});
  ASSERT_TRUE(free) << free.error().text;
  EXPECT_TRUE((*free)[1]);
  fleet.frozen[1] = 1;
  const auto refused = MakeWayForHoming(fleet.request(), {0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_THAT(refused.error().text, HasSubstr("unit 22"));
}

TEST(Plan, PositionAndSpanFollowTheSegments) {
  AxisPath path;
  path.Append({100, 40, 108});
  path.Append({2000, -70, 216});
  const AxisDrive drive;
  const double vector_s = SecondsPerVector(drive);
  EXPECT_EQ(PositionAt(7, path, drive, 0), 7);
  EXPECT_EQ(PositionAt(7, path, drive, 0.0099), 7);
  EXPECT_EQ(PositionAt(7, path, drive, 0.01 + vector_s / 2), 8);
  EXPECT_EQ(PositionAt(7, path, drive, 0.01 + 39.5 * vector_s), 47);
  EXPECT_EQ(PositionAt(7, path, drive, 0.19), 47);
  EXPECT_EQ(PositionAt(7, path, drive, 0.2 + vector_s), 46);
  EXPECT_EQ(PositionAt(7, path, drive, 100), -23);
  const Span span = SpanOf(7, path);
  EXPECT_EQ(span.low, -23);
  EXPECT_EQ(span.high, 47);
  UnitPlan plan;
  plan.path[0] = path;
  EXPECT_NEAR(EndOf(plan, UnitDrive{}), 0.2 + 70 * 2 * vector_s, 1e-12);
}

}  // namespace
}  // namespace focalfleet
