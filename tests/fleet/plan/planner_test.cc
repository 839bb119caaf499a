#include "fleet/plan/planner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/geometry/clearance.h"
#include "fleet/plan/scene.h"
#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckedRow;
using test::CheckOptions;
using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::HexFleet;
using test::MoveOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::Seed;
using test::UnitAt;
using ::testing::HasSubstr;

/// Two arms side by side between the bases, each below or above the other. Folding back (phi grows,
/// the tip turns counter-clockwise) runs into the other arm.
PlanningFleet YinYang(double left_theta_zero_deg = 0) {
  PlanningFleet fleet = FleetOf({UnitAt(1, 0, left_theta_zero_deg), UnitAt(2, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, -20 - left_theta_zero_deg, 20), PoseDeg(fleet, 1, 160, 20)});
  return fleet;
}

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
  // The way back leads into the lock again.
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
    // Targets are drawn around the units that stay.
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
      // Only units with certain places may be named as colliding.
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
      const auto report = focalfleet::test::Witnessed(truth, *plan);
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

TEST(Planner, ServesPairsThatAreClearByToleranceOnly) {
  // Two stretched arms tip to tip, up to 2 um nearer than half-widths and clearance: still clear by
  // the rule.
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 37.0)});
  const double need = ClearDistanceMm(fleet.layout, PositionerIndex{0}, PositionerIndex{1});
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
  while (gap() < need - kClearToleranceMm) ++right[0];
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
  // A plan for perfect clocks fails the same test: the margins carry the first plan.
  const auto tight =
      MakePlan(fleet.request(), {.fixed = false, .start_skew_s = 0, .clock_error = 0});
  ASSERT_TRUE(tight);
  EXPECT_FALSE(focalfleet::test::Witnessed(fleet, *tight, check).ok());
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
  for (CheckedRow row : focalfleet::test::CheckedRows(plan, fleet.layout, fleet.drives)) {
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
      const auto report = focalfleet::test::CheckPlan(
          focalfleet::test::CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
          rows, {}, options);
      EXPECT_TRUE(report.ok()) << "unit index " << unit << " ends at " << t_s << " s\n"
                               << report.Text();
    }
    Plan alone = *plan;
    for (UnitPlan& move : alone.moves) move.followers.clear();
    const auto rows = CutShort(fleet, alone, unit, t_s, false);
    touched_without +=
        focalfleet::test::CheckPlan(
            focalfleet::test::CheckedUnits(fleet.layout, fleet.drives, fleet.start, fleet.frozen),
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

}  // namespace
}  // namespace focalfleet
