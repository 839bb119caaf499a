// Plans for other objectives than an early end: never worse by their objective, never later, as
// clear.
#include "fleet/plan/objective.h"

#include <gtest/gtest.h>

#include "fleet/estimate.h"
#include "fleet/plan/power_statement.h"
#include "fleet/plan/sectors.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::DrawStartAndTargets;
using test::ExpectSound;
using test::FleetOf;
using test::PlanningFleet;
using test::TestSeed;

constexpr Objective kAll[] = {Objective::kLeastEnergy, Objective::kLeastPeak,
                              Objective::kEvenPower};

struct Made {
  Plan plan;
  PowerStatement power;
};

Made Make(const PlanningFleet& fleet, const PlanOptions& options) {
  auto plan = MakePlan(fleet.request(), options);
  if (!plan) {
    ADD_FAILURE() << plan.error().text;
    return {};
  }
  PowerStatement power = StatePower(*plan, fleet.layout, fleet.drives, options);
  return {std::move(*plan), std::move(power)};
}

/// The flatness of rails, each weighted by its power.
double RailFlatness(const PowerStatement& power) {
  double sum = 0;
  for (const RailStatement& rail : power.rails)
    sum += rail.energy_J * rail.energy_J / rail.flatness;
  double even = 0;
  for (const RailStatement& rail : power.rails) even += rail.energy_J * rail.energy_J;
  return even / sum;
}

/// The new plan is never worse by more than rounding.
void ExpectNotWorse(Objective objective, const Made& now, const Made& before, double slot_share) {
  switch (objective) {
    case Objective::kSoonest:
      break;
    case Objective::kLeastEnergy:
      EXPECT_LE(now.power.energy_J, before.power.energy_J * (1 + 1e-9));
      break;
    case Objective::kLeastPeak:
      EXPECT_LE(now.power.LargestRail_W(), before.power.LargestRail_W() * (1 + slot_share));
      break;
    case Objective::kEvenPower:
      EXPECT_GE(RailFlatness(now.power), RailFlatness(before.power) * (1 - slot_share));
      break;
  }
}

PlanningFleet Drawn(std::uint64_t seed) {
  PlanningFleet fleet = FleetOf(MakeHexLayout({.count = 127, .units_per_rail = 64}));
  DrawStartAndTargets(&fleet, seed);
  return fleet;
}

TEST(Objectives, AreServedWithinTheTimeAndClear) {
  for (std::uint64_t k = 0; k < 3; ++k) {
    const std::uint64_t seed = TestSeed(800 + k);
    FOCALFLEET_TRACE_SEED(seed);
    const PlanningFleet fleet = Drawn(seed);
    const Made soonest = Make(fleet, {});
    for (const Objective objective : kAll) {
      SCOPED_TRACE(static_cast<int>(objective));
      for (const double within_s : {0.0, 1.3 * soonest.plan.makespan_s}) {
        PlanOptions options;
        options.objective = objective;
        options.within_s = within_s;
        const Made made = Make(fleet, options);
        EXPECT_TRUE(made.plan.unserved.empty());
        EXPECT_LE(made.plan.makespan_s, (within_s > 0 ? within_s : soonest.plan.makespan_s) + 1e-6);
        EXPECT_EQ(made.plan.bound_s, soonest.plan.bound_s);
        EXPECT_LE(made.plan.unnoticed.size(), soonest.plan.unnoticed.size() + 2);
        ExpectSound(fleet, made.plan);
        if (within_s == 0) ExpectNotWorse(objective, made, soonest, 2e-3);
        std::printf(
            "FOCALFLEET_SEED=%llu objective %d within %.1f s: %.2f J of %.2f, rail's peak %.3f W "
            "of %.3f, flatness %.3f of %.3f\n",
            static_cast<unsigned long long>(seed), static_cast<int>(objective), within_s,
            made.power.energy_J, soonest.power.energy_J, made.power.LargestRail_W(),
            soonest.power.LargestRail_W(), RailFlatness(made.power), RailFlatness(soonest.power));
      }
    }
  }
}

TEST(Objectives, LowerWhatTheyAreForByMuch) {
  const std::uint64_t seed = TestSeed(810);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(seed);
  const Made soonest = Make(fleet, {});
  PlanOptions options;
  options.objective = Objective::kLeastPeak;
  EXPECT_LE(Make(fleet, options).power.LargestRail_W(), 0.7 * soonest.power.LargestRail_W());
  options.objective = Objective::kEvenPower;
  const Made even = Make(fleet, options);
  EXPECT_GE(RailFlatness(even.power), 1 - 0.5 * (1 - RailFlatness(soonest.power)));
  options.objective = Objective::kLeastEnergy;
  EXPECT_LE(Make(fleet, options).power.energy_J, 0.99 * soonest.power.energy_J);
}

TEST(Objectives, KeepLimitsOfPower) {
  const std::uint64_t seed = TestSeed(820);
  FOCALFLEET_TRACE_SEED(seed);
  const PlanningFleet fleet = Drawn(seed);
  const Made free = Make(fleet, {});
  for (const Objective objective : kAll) {
    PlanOptions options;
    options.power.rail_W = 0.6 * free.power.LargestRail_W();
    options.power.total_W = 0.55 * free.power.peak_most_W;
    options.objective = objective;
    const Made made = Make(fleet, options);
    EXPECT_LE(made.power.LargestRail_W(), options.power.rail_W + 1e-6);
    EXPECT_LE(made.power.peak_most_W, options.power.total_W + 1e-6);
    ExpectSound(fleet, made.plan);
  }
}

TEST(Objectives, SayWhatTimeIsFeasible) {
  const PlanningFleet fleet = Drawn(TestSeed(830));
  const Made soonest = Make(fleet, {});
  PlanOptions options;
  options.objective = Objective::kEvenPower;
  options.within_s = 0.9 * soonest.plan.bound_s;
  const auto plan = MakePlan(fleet.request(), options);
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kRefused);
  char expected[60];
  std::snprintf(expected, sizeof expected, "the soonest one takes %.2f s", soonest.plan.makespan_s);
  EXPECT_NE(plan.error().text.find(expected), std::string::npos) << plan.error().text;
}

TEST(Objectives, AndSectorsAreNotForPlansInStages) {
  const PlanningFleet fleet = Drawn(TestSeed(835));
  PlanOptions options;
  options.stall_tolerant = true;
  EXPECT_FALSE(PlanBySectors(fleet.request(), options, {.count = 2}));
  options.objective = Objective::kEvenPower;
  const auto plan = MakePlan(fleet.request(), options);
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kInvalid);
}

TEST(PowerOfAPlan, IsThatOfTheEstimateByNominalClocks) {
  const PlanningFleet fleet = Drawn(TestSeed(840));
  const Made made = Make(fleet, {});
  const PlanEstimate estimate = Estimate(made.plan, fleet.layout, fleet.drives, {});
  EXPECT_NEAR(made.power.energy_J, estimate.energy_J, 1e-6 * estimate.energy_J);
  EXPECT_NEAR(made.power.peak_W, estimate.peak_power_W, 1e-6);
  EXPECT_GE(made.power.peak_most_W, made.power.peak_W);
  ASSERT_EQ(made.power.rails.size(), estimate.rails.size());
  EXPECT_GT(made.power.flatness, 0);
  EXPECT_LE(made.power.flatness, 1);
}

TEST(PowerOfAMove, GrowsWithNSoThatSlowerIsDearer) {
  double before_J = 0;
  for (const int n : {37, 50, 80, 108, 160, 255}) {
    AxisDrive drive;
    drive.repeat = static_cast<std::uint8_t>(n);
    const double energy_J =
        SteadyPower({}, {.drive = drive}).total_W() * 1000 * SecondsPerVector(drive);
    EXPECT_GT(energy_J, before_J);
    before_J = energy_J;
  }
}

}  // namespace
}  // namespace focalfleet
