// Plans in which all units go at once: close to the bound, within limits of power at every instant,
// with notice. A search in time finds ways that waiting and folding do not find.
#include <gtest/gtest.h>

#include <map>

#include "fleet/estimate.h"
#include "fleet/plan/time_search.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckReport;
using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::HexFleet;
using test::MoveOf;
using test::PlanningFleet;
using test::TestSeed;
using test::Witnessed;

constexpr double kVectorS = 108 * 500 / 144e6;  // of an untuned drive

PlanningFleet Drawn(std::uint32_t count, std::uint64_t seed) {
  PlanningFleet fleet = HexFleet(count);
  DrawStartAndTargets(&fleet, seed);
  return fleet;
}

TEST(PlanAtOnce, TakesHardlyLongerThanTheSlowestUnitAlone) {
  std::vector<double> ratios;
  for (std::uint64_t k = 0; k < 6; ++k) {
    const std::uint64_t seed = TestSeed(300 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(217, seed);
    const auto plan = MakePlan(fleet.request(), {});
    ASSERT_TRUE(plan) << plan.error().text;
    double bound_s = 0;
    for (std::uint32_t i = 0; i < fleet.layout.size(); ++i)
      for (std::size_t axis = 0; axis < kAxisCount; ++axis)
        bound_s =
            std::max(bound_s, std::abs((*fleet.targets[i])[axis] - PlaceOf(fleet.start[i])[axis]) *
                                  kVectorS);
    EXPECT_NEAR(plan->bound_s, bound_s, 1e-9);
    EXPECT_GE(plan->makespan_s, bound_s - 1e-9);
    ratios.push_back(plan->makespan_s / bound_s);
    EXPECT_TRUE(plan->unserved.empty());
    ExpectSound(fleet, *plan);
  }
  std::sort(ratios.begin(), ratios.end());
  EXPECT_LE((ratios[2] + ratios[3]) / 2, 1.05);
  EXPECT_LE(ratios.back(), 1.25);
}

/// Power of each rail for the worst of all skews and clocks, summed from the rows. A row may run at
/// any instant between its earliest begin and its latest end.
double WorstRailPower(const PlanningFleet& fleet, const Plan& plan) {
  DrivePowers powers{MotorModel{}};
  std::map<std::uint32_t, std::map<double, double>> steps;
  for (const UnitPlan& move : plan.moves) {
    const UnitDrive& drive = fleet.drives[move.unit.value];
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      for (const Segment& segment : move.path[axis].segments()) {
        AxisDrive sent = drive.axis[axis];
        sent.repeat = segment.repeat;
        const double power_W = powers.Of({sent, drive.mode, drive.v_bus_V}).total_W();
        const double t0_s = segment.start_ticks * 1e-4;
        const double t1_s = t0_s + std::abs(segment.delta) * (sent.repeat * 500 / 144e6);
        auto& rail = steps[fleet.layout.unit(move.unit).rail.value];
        rail[t0_s / 1.005 - 0.02] += power_W;
        rail[t1_s / 0.995 + 0.02] -= power_W;
      }
    }
  }
  double worst_W = 0;
  for (const auto& [rail, changes] : steps) {
    double power_W = 0;
    for (const auto& [t_s, change_W] : changes) worst_W = std::max(worst_W, power_W += change_W);
  }
  return worst_W;
}

TEST(PlanAtOnce, KeepsRailLimitsForEverySkewAndClock) {
  for (const double share : {0.5, 0.25}) {
    const std::uint64_t seed = TestSeed(320);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(share == 0.5 ? 127 : 37, seed);
    const auto free = MakePlan(fleet.request(), {});
    ASSERT_TRUE(free);
    PlanOptions options;
    options.power.rail_W = share * WorstRailPower(fleet, *free);
    const auto plan = MakePlan(fleet.request(), options);
    ASSERT_TRUE(plan) << plan.error().text;
    EXPECT_TRUE(plan->unserved.empty());
    EXPECT_LE(WorstRailPower(fleet, *plan), options.power.rail_W + 1e-9);
    ExpectSound(fleet, *plan);
    double energy_J = 0;  // of straight ways
    for (std::uint32_t i = 0; i < fleet.layout.size(); ++i)
      for (std::size_t axis = 0; axis < kAxisCount; ++axis)
        energy_J +=
            std::abs((*fleet.targets[i])[axis] - PlaceOf(fleet.start[i])[axis]) * 108 * 500 /
            144e6 *
            SteadyPower({}, {fleet.drives[i].axis[axis], WaveMode::kAsymmetric, 1.8}).total_W();
    const double bound_s = std::max(plan->bound_s, energy_J / options.power.rail_W);
    EXPECT_LE(plan->makespan_s, (share == 0.5 ? 1.15 : 3) * bound_s);
  }
}

TEST(PlanAtOnce, NamesTheLeastLimitThatIsFeasible) {
  const PlanningFleet fleet = Drawn(7, TestSeed(330));
  PlanOptions options;
  options.power.total_W = 0.01;
  const auto plan = MakePlan(fleet.request(), options);
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kRefused);
  const double least_W = SteadyPower({}, {}).total_W();
  char expected[60];
  std::snprintf(expected, sizeof expected, "at least %.4f W are needed", least_W);
  EXPECT_NE(plan.error().text.find(expected), std::string::npos) << plan.error().text;
  options.power.total_W = 1.01 * least_W;
  const auto just = MakePlan(fleet.request(), options);
  ASSERT_TRUE(just) << just.error().text;
  EXPECT_TRUE(just->unserved.empty());
  ExpectSound(fleet, *just);
  EXPECT_LE(Estimate(*just, fleet.layout, fleet.drives, {}).peak_power_W, options.power.total_W);
}

TEST(PlanAtOnce, TightestPairsAreAsNearAsTheCheckerSeesThem) {
  const std::uint64_t seed = TestSeed(340);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(61, seed);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan);
  ASSERT_FALSE(plan->tightest.empty());
  for (std::size_t k = 1; k < plan->tightest.size(); ++k)
    EXPECT_LE(plan->tightest[k - 1].clearance_mm, plan->tightest[k].clearance_mm);
  const CheckReport report = Witnessed(fleet, *plan);
  // The checker tests only the corners of skew and clocks, the promise holds for all of them.
  EXPECT_GE(report.worst_margin_mm, plan->tightest.front().clearance_mm - 1e-4);
}

TEST(PlanAtOnce, NoUnitGoesWhereNoWayExists) {
  // The elbow itself cannot pass these two, on either side of the unit.
  std::vector<Unit> units = MakeHexLayout({.count = 1});
  PlanningFleet fleet =
      FleetOf(std::move(units),
              {.clearance_mm = 0.3, .obstacles = {{1, {0, 8.25}, 1}, {2, {0, -8.25}, 1}}});
  const auto vectors = [&](double degrees) {
    return NearestVectors(degrees, fleet.layout.unit({0}).theta(), fleet.drives[0].axis[0]);
  };
  fleet.StandAt({{0, vectors(90)}});
  fleet.targets[0] = Pose{vectors(180), vectors(90)};
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  ExpectSound(fleet, *plan);
  ASSERT_EQ(plan->unserved.size(), 1u);
  EXPECT_EQ(plan->unserved[0].why, UnservedWhy::kBlocked);
  ASSERT_TRUE(plan->unserved[0].proof);
  EXPECT_TRUE(plan->unserved[0].proof->obstacle);
  EXPECT_TRUE(plan->unserved[0].proof->walls.empty());
}

TEST(PlanAtOnce, RefusesALimitThatWouldTakeLongerThanAnOffsetCanSay) {
  // A single motor at a time: 200 units take some 3000 s.
  const PlanningFleet fleet = Drawn(200, TestSeed(331));
  PlanOptions options;
  options.power.rail_W = 1.01 * SteadyPower({}, {}).total_W();
  const auto plan = MakePlan(fleet.request(), options);
  ASSERT_FALSE(plan) << plan->moves.size() << " moves";
  EXPECT_EQ(plan.error().code, ErrorCode::kRefused);
  EXPECT_NE(plan.error().text.find("times as high"), std::string::npos) << plan.error().text;
}

TEST(TimeSearch, FindsAWayAmongAllOthersAsTheyGo) {
  const std::uint64_t seed = TestSeed(350);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(127, seed);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan);
  std::vector<ArmGeometry> arms;
  std::vector<Track> tracks;
  for (std::uint32_t i = 0; i < fleet.layout.size(); ++i) {
    arms.emplace_back(fleet.layout.unit({i}), fleet.drives[i]);
    const UnitPlan* move = MoveOf(*plan, i);
    tracks.push_back(move == nullptr ? Track(arms[i], PlaceOf(fleet.start[i]))
                                     : Track(arms[i], fleet.drives[i], move->from, move->path));
  }
  int found = 0;
  for (std::uint32_t i = 0; i < fleet.layout.size(); ++i) {
    std::vector<MovingNeighbour> moving;
    for (const PositionerIndex j : fleet.layout.neighbours({i})) {
      const double need_mm = fleet.layout.unit({i}).arm_half_width_mm +
                             fleet.layout.unit(j).arm_half_width_mm + fleet.layout.clearance_mm();
      moving.push_back({&arms[j.value], &tracks[j.value], need_mm, {}});
    }
    TimeSearch search;
    const auto paths = search.Find({.arm = &arms[i],
                                    .drive = &fleet.drives[i],
                                    .moving = moving,
                                    .from = PlaceOf(fleet.start[i]),
                                    .to = *fleet.targets[i],
                                    .within = arms[i].range(),
                                    .end_s = 2 * plan->makespan_s});
    if (!paths) continue;
    ++found;
    for (std::size_t k = 0; k < kAxisCount; ++k) {
      std::int32_t at = PlaceOf(fleet.start[i])[k];
      for (const Segment& segment : (*paths)[k].segments()) at += segment.delta;
      EXPECT_EQ(at, (*fleet.targets[i])[k]);
    }
    const Track track(arms[i], fleet.drives[i], PlaceOf(fleet.start[i]), *paths);
    for (const MovingNeighbour& neighbour : moving)
      EXPECT_TRUE(PassesClear(arms[i], track, *neighbour.arm, *neighbour.track,
                              neighbour.need_mm - 1e-3, neighbour.tolerance));
  }
  EXPECT_GE(found, 120);
}

}  // namespace
}  // namespace focalfleet
