#include "sim/drive/tuning/tuning.h"

#include <gtest/gtest.h>

#include <cmath>

namespace focalfleet::sim {
namespace {

// The sets were fitted without dead time and ramps.
Drive::Setting Ideal(double v_bus_V) {
  return {
      *FindParameterSet("9"), {}, {.v_bus_V = v_bus_V, .rise_s = 0, .fall_s = 0, .dead_time_s = 0}};
}

TEST(Tuning, FindsThePapersCriticalRepeatAndKeepsTheMargin) {
  const Tuning tuning = Tune(Ideal(1.8), {}, {});
  EXPECT_EQ(tuning.outcome, TuningOutcome::kTuned);
  EXPECT_EQ(tuning.critical, 37);
  EXPECT_EQ(tuning.critical_reduced, 37);
  EXPECT_NEAR(tuning.margin, 0.5, 0.02);
  // The load is half as much again by itself.
  Drive::Setting heavier = Ideal(1.8);
  heavier.motor.load_Nm *= 1.5;
  EXPECT_EQ(CriticalRepeat(heavier, {}, {}, DriveLevel::kReduced), tuning.repeat);
  // The gearhead makes 743 turns of 96 vectors.
  EXPECT_NEAR(tuning.move_s, 300.0 / 360 * 337 * 45 / 17 * 96 * tuning.repeat * 500 / 144e6, 1e-3);
  EXPECT_GT(tuning.move_J, tuning.copper_W * tuning.move_s * 0.99);
}

TEST(Tuning, ThePapersDefaultHasNearlyTwiceTheLoad) {
  EXPECT_NEAR(MarginOf(Ideal(1.8), {.repeat = 108}), 0.88, 0.03);
  EXPECT_NEAR(MarginOf(Ideal(1.8), {.repeat = 37}), 0, 0.02);
}

TEST(Tuning, RefusesCurrentsNearWhatThePhaseCanReach) {
  const TuningRule rule{.cross_check = false};
  const Drive::Setting bench{*FindParameterSet("9"), {}, {.v_bus_V = 9}};
  const Tuning slow = Tune(bench, {.counter1 = 2000}, rule);
  EXPECT_EQ(slow.outcome, TuningOutcome::kPeak);
  EXPECT_GT(slow.peak_share, 0.98);
  EXPECT_LT(slow.peak_share, 1);
  const Tuning fast = Tune(bench, {.counter1 = 250}, rule);
  EXPECT_EQ(fast.outcome, TuningOutcome::kTuned);
  EXPECT_NEAR(fast.blocked_peak_A, 0.359, 0.002);
  EXPECT_NEAR(fast.limit_A, 0.34991, 1e-5);
}

TEST(Tuning, LoadsBeyondTheMotorAreDistinguished) {
  const TuningRule rule{.cross_check = false};
  Drive::Setting setting = Ideal(1.8);
  setting.motor.load_Nm = 18e-6;
  EXPECT_EQ(Tune(setting, {}, rule).outcome, TuningOutcome::kNoMargin);
  setting.motor.load_Nm = 28e-6;
  EXPECT_EQ(Tune(setting, {}, rule).outcome, TuningOutcome::kStalls);
}

TEST(Tuning, AWarmWindingNeedsMoreTimeAndIsInBalance) {
  const TuningRule rule{.winding_K_per_W = 300, .cross_check = false};
  const Tuning cold = Tune(Ideal(1.8), {}, {.cross_check = false});
  const Tuning warm = Tune(Ideal(1.8), {}, rule);
  EXPECT_GT(warm.repeat, cold.repeat);
  EXPECT_NEAR(warm.winding_C, 20 + 300 * warm.copper_W, 0.05);
  EXPECT_NEAR(warm.resistance_ohm, 14.85 * (1 + 0.00393 * (warm.winding_C - 20)), 1e-3);
}

TEST(Tuning, AFleetIsTunedAsEachOfItsLoads) {
  const TuningRule rule{.cross_check = false, .measure_move = true};
  const std::vector<double> loads = {11e-6, 12e-6, 11.5e-6, 11e-6, 11.52e-6, 30e-6};
  const auto fleet = TuneLoads(Ideal(1.8), {}, rule, loads, {});
  ASSERT_EQ(fleet.size(), loads.size());
  for (std::size_t k = 0; k < loads.size(); ++k) {
    Drive::Setting setting = Ideal(1.8);
    setting.motor.load_Nm = loads[k];
    const Tuning alone = Tune(setting, {}, rule);
    EXPECT_EQ(fleet[k].outcome, alone.outcome);
    EXPECT_EQ(fleet[k].critical, alone.critical);
    EXPECT_EQ(fleet[k].repeat, alone.repeat);
    // The load that n starts is known to 1e-4 of the stall torque, and half a count is
    // interpolated.
    EXPECT_NEAR(fleet[k].margin, alone.margin, 5e-3);
    EXPECT_GE(fleet[k].margin, alone.outcome == TuningOutcome::kTuned ? rule.margin : 0);
    EXPECT_NEAR(fleet[k].peak_share, alone.peak_share, 1e-6);
    EXPECT_NEAR(fleet[k].move_s, alone.move_s, 1e-9);
    // The fleet's figure is from steady rotation with the mean load, the other from the whole move.
    EXPECT_NEAR(fleet[k].move_J, alone.move_J, 0.005 * alone.move_J);
  }
}

TEST(Tuning, CriticalLoadsAndCriticalRepeatsAreOneTableReadTwoWays) {
  const Drive::Setting setting = Ideal(1.8);
  CriticalLoads loads(setting, {});
  double below = 0;
  for (const int repeat : {30, 36, 37, 44}) {
    const double load_Nm = loads.Of(repeat);
    EXPECT_GT(load_Nm, below);
    below = load_Nm;
    EXPECT_EQ(loads.RepeatFor(load_Nm * 0.998), repeat);
    EXPECT_EQ(loads.RepeatFor(load_Nm * 1.002), repeat + 1);
    Drive::Setting at = setting;
    at.motor.load_Nm = load_Nm * 0.998;
    EXPECT_EQ(CriticalRepeat(at, {}, {}, DriveLevel::kReduced), repeat);
  }
  EXPECT_EQ(loads.Of(4), 0) << "not even without a load";
  EXPECT_FALSE(loads.RepeatFor(30e-6));
}

}  // namespace
}  // namespace focalfleet::sim
