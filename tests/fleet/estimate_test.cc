#include "fleet/estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>

#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr double kPaperGear = 337.0 * 45 / 17;

double SecondsPerTurn(std::uint8_t repeat) {
  const AxisGeometry axis{8.25, 0, kPaperGear, -190, 190};
  const AxisDrive drive{500, repeat, 96};
  return 360 / DegreesPerVector(axis, drive) * SecondsPerVector(drive);
}

TEST(DriveTime, TurnsTakeThePapersTimes) {
  EXPECT_NEAR(SecondsPerTurn(108), 32.11, 0.005);  // paper 1: 32.1 s
  EXPECT_NEAR(SecondsPerTurn(37), 11.00, 0.005);   // paper 1: 11 s
}

TEST(DriveTime, TickTimesAreTheNearestDecimals) {
  const SegmentTime time = TimeOf({12'345, -96, 108}, {});
  EXPECT_EQ(time.t0_s, 1.2345);
  EXPECT_DOUBLE_EQ(time.t1_s, 1.2345 + 96 * 0.375e-3);
}

struct Case {
  Layout layout;
  std::vector<UnitDrive> drives;
  Plan plan;
};

Case RandomCase(std::uint64_t seed) {
  Rng rng(seed);
  auto units = MakeHexLayout({.count = 60, .units_per_bus = 10, .units_per_rail = 20});
  Case c{*Layout::Create(units, {}), std::vector<UnitDrive>(60), {}};
  for (std::uint32_t i = 0; i < 60; i += 1 + static_cast<std::uint32_t>(rng.Below(2))) {
    UnitPlan move;
    move.unit = PositionerIndex{i};
    move.mode = static_cast<WaveMode>(rng.Below(3));
    for (AxisPath& path : move.path) {
      std::uint32_t tick = 0;
      for (std::uint64_t k = rng.Below(4); k > 0; --k) {
        const auto delta = static_cast<std::int32_t>(rng.Below(2000)) - 1000;
        path.Append({tick, delta, static_cast<std::uint8_t>(60 + rng.Below(60))});
        tick += 10'000 + static_cast<std::uint32_t>(rng.Below(4)) * 1000;
      }
    }
    c.plan.moves.push_back(move);
  }
  return c;
}

double PowerAt(const std::vector<PowerStep>& steps, double t_s) {
  double power_W = 0;
  for (const PowerStep& step : steps)
    if (step.t_s <= t_s) power_W = step.power_W;
  return power_W;
}

TEST(Estimate, CurvesAreTheSumOfTheMotorsThatRunAtEachInstant) {
  const std::uint64_t seed = test::TestSeed(31);
  FOCALFLEET_TRACE_SEED(seed);
  const Case c = RandomCase(seed);
  DrivePowers powers(MotorModel{});
  const PlanEstimate estimate = Estimate(c.plan, c.layout, c.drives, {});
  Rng rng(seed + 1);
  for (int k = 0; k < 300; ++k) {
    const double t_s = rng.Uniform(-0.1, estimate.makespan_s + 0.1);
    std::map<std::uint32_t, double> rail_W;
    double total_W = 0;
    for (const UnitPlan& move : c.plan.moves)
      for (const AxisPath& path : move.path)
        for (const Segment& s : path.segments()) {
          const double begin_s = s.start_ticks * 1e-4;
          const double end_s = begin_s + std::abs(s.delta) * s.repeat * 500 / 144e6;
          if (t_s < begin_s || t_s >= end_s) continue;
          const double power_W = powers.Of({{500, s.repeat, 96}, move.mode, 1.8}).total_W();
          rail_W[c.layout.unit(move.unit).rail.value] += power_W;
          total_W += power_W;
        }
    EXPECT_NEAR(PowerAt(estimate.total, t_s), total_W, 1e-6);
    EXPECT_LE(total_W, estimate.peak_power_W + 1e-6);
    for (const RailCurve& rail : estimate.rails)
      EXPECT_NEAR(PowerAt(rail.steps, t_s), rail_W[rail.rail.value], 1e-6);
  }
}

TEST(Estimate, EveryCurveEndsAtExactlyNothingAndHoldsTheEnergy) {
  const Case c = RandomCase(5);
  const PlanEstimate estimate = Estimate(c.plan, c.layout, c.drives, {});
  ASSERT_EQ(estimate.rails.size(), 3u);
  double energy_J = 0;
  double peak_W = 0;
  for (std::size_t k = 0; k + 1 < estimate.total.size(); ++k) {
    EXPECT_LT(estimate.total[k].t_s, estimate.total[k + 1].t_s);
    energy_J += estimate.total[k].power_W * (estimate.total[k + 1].t_s - estimate.total[k].t_s);
    peak_W = std::max(peak_W, estimate.total[k].power_W);
  }
  EXPECT_NEAR(energy_J, estimate.energy_J, 1e-6);
  EXPECT_EQ(peak_W, estimate.peak_power_W);
  EXPECT_EQ(estimate.total.back().power_W, 0);
  EXPECT_EQ(estimate.total.back().t_s, estimate.makespan_s);
  for (const RailCurve& rail : estimate.rails) EXPECT_EQ(rail.steps.back().power_W, 0);
  for (std::size_t k = 1; k < estimate.rails.size(); ++k)
    EXPECT_LT(estimate.rails[k - 1].rail, estimate.rails[k].rail);
}

TEST(Estimate, APlanWithoutMovesTakesNothing) {
  const auto layout = Layout::Create(MakeHexLayout({.count = 3}), {});
  const PlanEstimate estimate = Estimate({}, *layout, std::vector<UnitDrive>(3), {});
  EXPECT_EQ(estimate.makespan_s, 0);
  EXPECT_EQ(estimate.energy_J, 0);
  EXPECT_TRUE(estimate.total.empty());
  EXPECT_TRUE(estimate.rails.empty());
}

TEST(EstimateWithSpread, HoldsTheNominalCurvesAndTheirRailsAddUp) {
  const std::uint64_t seed = test::TestSeed(8);
  FOCALFLEET_TRACE_SEED(seed);
  const Case c = RandomCase(seed);
  const EstimateFigures figures = EstimateWithSpread(c.plan, c.layout, c.drives, {});
  const PlanEstimate alone = Estimate(c.plan, c.layout, c.drives, {});
  EXPECT_EQ(figures.nominal.makespan_s, alone.makespan_s);
  EXPECT_EQ(figures.total.peak_power_W.nominal, alone.peak_power_W);
  EXPECT_NEAR(figures.total.energy_J.nominal, alone.energy_J, 1e-6);
  EXPECT_NEAR(figures.total.mean_power_W.nominal, alone.energy_J / alone.makespan_s, 1e-7);
  ASSERT_EQ(figures.rails.size(), 3u);
  double rails_J = 0;
  for (const RailFigures& rail : figures.rails) rails_J += rail.power.energy_J.nominal;
  EXPECT_NEAR(rails_J, alone.energy_J, 1e-6);
  EXPECT_FALSE(figures.stalls);
  EXPECT_FALSE(figures.stalls_within_spread);
}

TEST(EstimateWithSpread, LimitsHoldEveryMotorWithinTheSpread) {
  const std::uint64_t seed = test::TestSeed(9);
  FOCALFLEET_TRACE_SEED(seed);
  const Case c = RandomCase(seed);
  const EstimateSpread spread{.load = 0.2, .resistance = 0.1, .model_error = 0};
  const EstimateFigures figures = EstimateWithSpread(c.plan, c.layout, c.drives, {}, spread);
  const auto holds = [](const Banded& band, double value) {
    return band.low <= value * (1 + 1e-4) && value <= band.high * (1 + 1e-4);
  };
  Rng rng(seed);
  for (int k = 0; k < 5; ++k) {
    MotorModel motor;
    motor.load_torque_Nm *= rng.Uniform(1 - spread.load, 1 + spread.load);
    motor.phase_resistance_ohm *= rng.Uniform(1 - spread.resistance, 1 + spread.resistance);
    const PlanEstimate estimate = Estimate(c.plan, c.layout, c.drives, motor);
    EXPECT_TRUE(holds(figures.total.energy_J, estimate.energy_J)) << k;
    EXPECT_TRUE(holds(figures.total.peak_power_W, estimate.peak_power_W)) << k;
  }
  // The bus fixes the voltage: the power is nearly proportional to 1 / r.
  EXPECT_NEAR(figures.total.energy_J.low / figures.total.energy_J.nominal, 1 / 1.1, 0.02);
  EXPECT_NEAR(figures.total.energy_J.high / figures.total.energy_J.nominal, 1 / 0.9, 0.02);
}

TEST(EstimateWithSpread, TheModelsErrorAndTheClocksWidenTheLimits) {
  const Case c = RandomCase(5);
  const EstimateSpread exact{
      .load = 0, .resistance = 0, .model_error = 0.02, .start_skew_s = 0.1, .clock_error = 0.01};
  const EstimateFigures f = EstimateWithSpread(c.plan, c.layout, c.drives, {}, exact);
  const auto expect_band = [](const Banded& band, double slack) {
    EXPECT_NEAR(band.low, band.nominal - slack, 1e-9);
    EXPECT_NEAR(band.high, band.nominal + slack, 1e-9);
  };
  expect_band(f.total.energy_J, 0.02 * f.total.energy_J.nominal);
  expect_band(f.total.mean_power_W, 0.02 * f.total.mean_power_W.nominal);
  expect_band(f.rails[1].power.peak_power_W, 0.02 * f.rails[1].power.peak_power_W.nominal);
  expect_band(f.makespan_s, 0.1 + 0.01 * f.makespan_s.nominal);
}

TEST(EstimateWithSpread, TellsWhereMotorsCannotPullTheirLoad) {
  Case c = RandomCase(5);
  MotorModel motor;
  motor.load_torque_Nm = 11e-6;  // pull-out at 1.8 V is about 14 uNm
  EstimateFigures figures = EstimateWithSpread(c.plan, c.layout, c.drives, motor);
  EXPECT_FALSE(figures.stalls);
  EXPECT_TRUE(figures.stalls_within_spread);
  motor.load_torque_Nm = 20e-6;
  figures = EstimateWithSpread(c.plan, c.layout, c.drives, motor);
  EXPECT_TRUE(figures.stalls);
  EXPECT_GT(figures.nominal.stalled_segments, 0u);
}

TEST(EstimateWithSpread, APlanWithoutMovesHasNoUncertainty) {
  const auto layout = Layout::Create(MakeHexLayout({.count = 3}), {});
  const EstimateFigures f = EstimateWithSpread({}, *layout, std::vector<UnitDrive>(3), {});
  EXPECT_EQ(f.makespan_s.high, 0);
  EXPECT_EQ(f.total.mean_power_W.high, 0);
  EXPECT_TRUE(f.rails.empty());
}

}  // namespace
}  // namespace focalfleet
