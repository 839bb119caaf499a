#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "fleet/plan/planner.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckOptions;
using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::Seed;
using test::UnitAt;
using ::testing::HasSubstr;

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
  // The two are never nearer than they start, by the checker's own distance.
  const auto before = focalfleet::test::Witnessed(fleet, {});
  ASSERT_LT(before.worst_margin_mm, -0.1);
  CheckOptions options;
  options.tolerance_mm = -before.worst_margin_mm + 2e-4;
  ExpectSound(fleet, *plan, options);
}

TEST(Planner, SendsNoOtherUnitThroughItsCellBecauseTwoStartTooNear) {
  // The two units of the test above, and one far away that has a degree to go.
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

TEST(Planner, ServesUnitsThatMerelyStartTooNear) {
  // The two units of the tests above; either both go, or the other stands and may not move.
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

TEST(Planner, LeavesStuckUnitsWhenAskedToAndTheOthersGoStraight) {
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
  // The unit stands 3 degrees of phi less than it counts: 178 degrees would be 181 by its count.
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

}  // namespace
}  // namespace focalfleet
