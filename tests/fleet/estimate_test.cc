#include "fleet/estimate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
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

TEST(SteadyPower, TheTunedMotorHeatsAboutATenthOfAWatt) {
  const MotorPower power = SteadyPower({}, {500, 108, 96}, WaveMode::kAsymmetric, 1.8);
  EXPECT_NEAR(power.winding_W, 0.1, 0.015);  // I = 69.98 mA: 1.5 r I^2 = 0.109 W, less the back EMF
  EXPECT_NEAR(power.mechanical_W, 5.8e-6 * 174.5, 2e-5);
  EXPECT_LT(power.switching_W, 0.03 * power.winding_W);
}

TEST(SteadyPower, StandingMotorDrawsThePapersLimitCurrent) {
  MotorModel motor;
  motor.load_torque_Nm = motor.viscous_Nms = 0;
  // So slow that it stands: V / (sqrt(3) r), 69.98 mA at 1.8 V and 349.91 mA at 9 V.
  const AxisDrive slow{65'000, 255, 65'000};
  for (const auto& [v_bus_V, current_A] : {std::pair{1.8, 69.98e-3}, std::pair{9.0, 349.91e-3}}) {
    const double winding_W = SteadyPower(motor, slow, WaveMode::kAsymmetric, v_bus_V).winding_W;
    EXPECT_NEAR(std::sqrt(winding_W / (1.5 * 14.85)), current_A, 1e-5);
  }
}

// An independent way to the same current: a phasor, the load angle found by bisection.
TEST(SteadyPower, AgreesWithThePhasorOfTheLoadAngle) {
  const std::uint64_t seed = testing::TestSeed(7);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 200; ++k) {
    MotorModel motor;
    motor.flux_linkage_Wb = rng.Uniform(0.1e-3, 0.3e-3);
    motor.load_torque_Nm = rng.Uniform(0, 6e-6);
    const AxisDrive drive{500, static_cast<std::uint8_t>(40 + rng.Below(200)), 96};
    const double v_bus_V = rng.Uniform(1.7, 3);
    const double w = 2 * 3.14159265358979 / (96 * SecondsPerVector(drive));
    const double torque = motor.load_torque_Nm + motor.viscous_Nms * w;
    const std::complex<double> z(motor.phase_resistance_ohm, w * motor.phase_inductance_H);
    const auto current = [&](double lead) {
      // d axis real, q axis imaginary; back EMF on q; the voltage leads the d axis by `lead`.
      const std::complex<double> v = std::polar(v_bus_V / std::sqrt(3.0), lead);
      return (v - std::complex<double>(0, w * motor.flux_linkage_Wb)) / z;
    };
    double low = 0;
    double high = 1.5;
    for (int step = 0; step < 100; ++step) {
      const double middle = (low + high) / 2;
      const double pull = 1.5 * motor.flux_linkage_Wb * current(middle).imag();
      (pull < torque ? low : high) = middle;
    }
    const double winding_W = 1.5 * motor.phase_resistance_ohm * std::norm(current(low));
    const MotorPower power = SteadyPower(motor, drive, WaveMode::kAsymmetric, v_bus_V);
    EXPECT_NEAR(power.winding_W, winding_W, 1e-9 + 1e-6 * winding_W);
    EXPECT_NEAR(power.mechanical_W, torque * w, 1e-12);
  }
}

TEST(SteadyPower, SevenSegmentsCostHalfAgainAsMuchSwitching) {
  const auto switching = [](WaveMode mode) { return SteadyPower({}, {}, mode, 1.8).switching_W; };
  EXPECT_EQ(switching(WaveMode::kAsymmetric), switching(WaveMode::kFiveSegment));
  EXPECT_DOUBLE_EQ(switching(WaveMode::kSevenSegment), 1.5 * switching(WaveMode::kAsymmetric));
}

TEST(SteadyPower, BeyondPullOutStaysFinite) {
  MotorModel motor;
  motor.load_torque_Nm = 1;
  const MotorPower power = SteadyPower(motor, {}, WaveMode::kAsymmetric, 1.8);
  EXPECT_TRUE(std::isfinite(power.total_W()));
  EXPECT_GT(power.winding_W, 0.05);
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
  const std::uint64_t seed = testing::TestSeed(31);
  FOCALFLEET_TRACE_SEED(seed);
  const Case c = RandomCase(seed);
  const MotorModel motor;
  const PlanEstimate estimate = Estimate(c.plan, c.layout, c.drives, motor);
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
          const double power_W = SteadyPower(motor, {500, s.repeat, 96}, move.mode, 1.8).total_W();
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

}  // namespace
}  // namespace focalfleet
