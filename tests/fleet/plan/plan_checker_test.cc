// The checker itself is checked. Plans that are wrong in known ways must be caught. Distances must
// equal those of a slow and simple computation.
#include "tests/support/plan_checker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "protocol/base/rng.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckedObstacle;
using test::CheckedRow;
using test::CheckedUnit;
using test::CheckOptions;
using test::CheckPlan;
using test::DrawStartAndTargets;
using test::ExpectSound;
using test::HexFleet;
using test::PlanningFleet;
using test::TestSeed;
using test::Witnessed;

CheckedUnit Stretched(std::uint32_t id, std::complex<double> base_mm, double theta_deg) {
  CheckedUnit unit;
  unit.id = id;
  unit.base_x_mm = base_mm.real();
  unit.base_y_mm = base_mm.imag();
  unit.axis[0] = {8.25, 0, -190, 190, theta_deg};
  unit.axis[1] = {8.25, 0, 0, 180, 0};
  unit.half_width_mm = 2;
  return unit;
}

CheckOptions NoClearance() {
  CheckOptions options;
  options.clearance_mm = 1e-12;
  return options;
}

TEST(PlanChecker, MeasuresStandingArmsExactly) {
  // From (16.5, 0), the tip of one, to (30, 8.25), the elbow of the other; 4 mm are needed.
  const std::vector<CheckedUnit> units{Stretched(1, {0, 0}, 0), Stretched(2, {30, 0}, 90)};
  const auto report = CheckPlan(units, {}, {}, NoClearance());
  EXPECT_TRUE(report.ok());
  EXPECT_NEAR(report.worst_margin_mm, std::hypot(13.5, 8.25) - 4, 1e-9);
  const auto tips =
      CheckPlan({Stretched(1, {0, 0}, 0), Stretched(2, {36.99, 0}, 180)}, {}, {}, NoClearance());
  EXPECT_FALSE(tips.ok());
  const auto crossing =
      CheckPlan({Stretched(1, {0, 0}, 0), Stretched(2, {12, -12}, 90)}, {}, {}, NoClearance());
  EXPECT_FALSE(crossing.ok());
  EXPECT_NEAR(crossing.worst_margin_mm, -4, 1e-9);
}

TEST(PlanChecker, FindsAContactOfAnInstant) {
  // The first arm sweeps past the tip of the other within a long motion: near for milliseconds
  // only.
  const std::vector<CheckedRow> rows{{1, 0, 0, 16, -90, 90}};
  const auto passing = [&](double tip_mm) {
    return CheckPlan({Stretched(1, {0, 0}, -90), Stretched(2, {tip_mm, -16.5}, 90)}, rows, {},
                     NoClearance());
  };
  EXPECT_TRUE(passing(20.51).ok()) << passing(20.51).Text();
  EXPECT_NEAR(passing(20.51).worst_margin_mm, 0.01, 1e-3);
  EXPECT_TRUE(passing(20.4985).ok()) << "within the tolerance";
  EXPECT_FALSE(passing(20.497).ok());
}

TEST(PlanChecker, FindsContactsThatOnlySkewOrClocksMake) {
  // The first arm sweeps through the middle, the other comes down into the same place afterwards.
  const std::vector<CheckedUnit> units{Stretched(1, {0, 0}, -90), Stretched(2, {30, 0}, 90)};
  std::vector<CheckedRow> rows{{1, 0, 0, 16, -90, 90}, {2, 0, 0, 0, 90, 180}};
  CheckOptions exact = NoClearance();
  exact.start_skew_s = 0;
  exact.clock_error = 0;
  const auto clear_at = [&](double begin_s, const CheckOptions& options) {
    rows[1].t0_s = begin_s;
    rows[1].t1_s = begin_s + 8;
    return CheckPlan(units, rows, {}, options).ok();
  };
  double begin_s = 1;
  ASSERT_FALSE(clear_at(begin_s, exact));
  while (!clear_at(begin_s, exact)) begin_s += 0.005;
  EXPECT_FALSE(clear_at(begin_s, NoClearance()));
  EXPECT_TRUE(clear_at(begin_s + 0.04 + 2 * 0.005 * 24, NoClearance()));
  CheckOptions skew_only = exact;
  skew_only.start_skew_s = 0.02;
  EXPECT_FALSE(clear_at(begin_s + 0.03, skew_only));
  EXPECT_TRUE(clear_at(begin_s + 0.045, skew_only));
  CheckOptions clock_only = exact;
  clock_only.clock_error = 0.005;
  EXPECT_FALSE(clear_at(begin_s + 0.02, clock_only));
}

TEST(PlanChecker, NamesRowsThatAreNoMotion) {
  const std::vector<CheckedUnit> units{Stretched(1, {0, 0}, 0)};
  const auto faulty = [&](const std::vector<CheckedRow>& rows) {
    return !CheckPlan(units, rows, {}, NoClearance()).ok();
  };
  EXPECT_FALSE(faulty({{1, 0, 0, 1, 0, 5}, {1, 0, 1, 2, 5, 9}}));
  EXPECT_TRUE(faulty({{1, 0, 0, 1, 0.1, 5}})) << "does not begin where it stands";
  EXPECT_TRUE(faulty({{1, 0, 0, 1, 0, 5}, {1, 0, 1, 2, 6, 9}})) << "does not join up";
  EXPECT_TRUE(faulty({{1, 0, 0, 1, 0, 5}, {1, 0, 0.9, 2, 5, 9}})) << "overlaps";
  EXPECT_TRUE(faulty({{1, 0, 0, 1, 0, 191}})) << "leaves the range";
  EXPECT_TRUE(faulty({{1, 0, 1, 0, 0, 5}})) << "ends before it begins";
  EXPECT_TRUE(faulty({{1, 0, 1, 1, 0, 5}})) << "jumps";
  EXPECT_TRUE(faulty({{7, 0, 0, 1, 0, 5}})) << "nobody's row";
  EXPECT_TRUE(faulty({{1, 0, 0, NAN, 0, 5}})) << "no number";
}

TEST(PlanChecker, FindsObstacles) {
  const std::vector<CheckedRow> rows{{1, 0, 0, 16, 0, 90}};
  const std::vector<CheckedObstacle> aside{{9, -10, -10, 1}};
  const std::vector<CheckedObstacle> in_the_way{{9, 10, 10, 1}};
  EXPECT_TRUE(CheckPlan({Stretched(1, {0, 0}, 0)}, rows, aside, NoClearance()).ok());
  EXPECT_FALSE(CheckPlan({Stretched(1, {0, 0}, 0)}, rows, in_the_way, NoClearance()).ok());
}

TEST(PlanChecker, CatchesAUnitThatStartsAtTheWrongTime) {
  PlanningFleet fleet = HexFleet(61);
  const std::uint64_t seed = TestSeed(77);
  FOCALFLEET_TRACE_SEED(seed);
  DrawStartAndTargets(&fleet, seed);
  const auto plan = MakePlan(fleet.request(), {});
  ASSERT_TRUE(plan) << plan.error().text;
  ExpectSound(fleet, *plan);
  // Units that others wait for begin half a minute late.
  int late = 0;
  int caught = 0;
  for (std::size_t m = 0; m < plan->moves.size(); ++m) {
    if (plan->moves[m].followers.empty()) continue;
    Plan wrong = *plan;
    ++late;
    for (AxisPath& path : wrong.moves[m].path) {
      AxisPath later;
      for (Segment s : path.segments()) {
        s.start_ticks += 300'000;
        later.Append(s);
      }
      path = later;
    }
    caught += Witnessed(fleet, wrong).ok() ? 0 : 1;
  }
  ASSERT_GT(late, 5);
  EXPECT_GT(2 * caught, late) << caught << " of " << late;
}

}  // namespace
}  // namespace focalfleet
