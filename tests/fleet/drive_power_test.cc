// The power of a motor against closed forms. A winding so slow that its current has no ripple is
// compared with the circle of the sinusoid. A winding so fast that it has no memory is compared
// with the duty. A pulse between the two is compared with its exponentials.
#include "fleet/drive_power.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr WaveMode kModes[] = {WaveMode::kAsymmetric, WaveMode::kFiveSegment,
                               WaveMode::kSevenSegment};

MotorModel WithoutEdges() {
  MotorModel motor;
  motor.dead_time_s = motor.switch_rise_s = motor.switch_fall_s = 0;
  return motor;
}

struct Point {
  MotorModel motor;
  Feed feed;
};

Point RandomPoint(Rng* rng) {
  Point p;
  p.motor.flux_linkage_Wb = rng->Uniform(0.15e-3, 0.3e-3);
  p.motor.load_torque_Nm = rng->Uniform(1e-6, 12e-6);
  p.motor.dead_time_s = rng->Uniform(0, 100e-9);
  p.feed.v_bus_V = rng->Uniform(1.7, 9.2);
  p.feed.mode = kModes[rng->Below(3)];
  p.feed.drive.counter1 = static_cast<std::uint16_t>(250 + rng->Below(1751));
  p.feed.drive.repeat = static_cast<std::uint8_t>(20 + rng->Below(101));
  p.feed.drive.subdivision = static_cast<std::uint16_t>(6 << rng->Below(5));
  return p;
}

double SumOf(const TurnMeans& means) {
  return means.winding_W + means.mechanical_W + means.switching_W;
}

TEST(MeansOverTurn, WhatTheBridgeGivesIsWhatWindingShaftAndSwitchesTake) {
  const std::uint64_t seed = test::TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 60; ++k) {
    const Point p = RandomPoint(&rng);
    const double lag_rad = rng.Uniform(-0.2, 1.4);
    const auto exact = MeansOverTurn(p.motor, p.feed, {.lag_rad = lag_rad, .every_carrier = true});
    EXPECT_NEAR(SumOf(exact) / exact.supply_W, 1, 1e-9) << k;
    const auto sampled = MeansOverTurn(p.motor, p.feed, {.lag_rad = lag_rad});
    EXPECT_NEAR(SumOf(sampled) / sampled.supply_W, 1, 1e-4) << k;
    EXPECT_NEAR(sampled.supply_W / exact.supply_W, 1, 5e-4) << k;
    EXPECT_NEAR(sampled.switching_W / exact.switching_W, 1, 0.02) << k;
  }
}

TEST(MeansOverTurn, DoNotDependOnWhereTheTurnIsCutOpen) {
  const std::uint64_t seed = test::TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 30; ++k) {
    const Point p = RandomPoint(&rng);
    const auto at_zero = MeansOverTurn(p.motor, p.feed, {.lag_rad = 0.5, .every_carrier = true});
    const auto first = static_cast<std::uint32_t>(rng.Below(p.feed.drive.subdivision));
    const auto elsewhere = MeansOverTurn(
        p.motor, p.feed, {.lag_rad = 0.5, .first_vector = first, .every_carrier = true});
    EXPECT_NEAR(elsewhere.supply_W / at_zero.supply_W, 1, 1e-9) << k << " from " << first;
    EXPECT_NEAR(elsewhere.switching_W / at_zero.switching_W, 1, 1e-7) << k << " from " << first;
    EXPECT_NEAR(elsewhere.torque_Nm, at_zero.torque_Nm, 1e-9 * std::abs(at_zero.torque_Nm));
  }
}

TEST(MeansOverTurn, ASlowWindingDrawsThePapersLimitCurrentAtRest) {
  MotorModel motor = WithoutEdges();
  motor.phase_inductance_H *= 100;
  // V / (sqrt(3) r): 69.98 mA at 1.8 V and 349.91 mA at 9 V.
  for (const auto& [v_bus_V, current_A] : {std::pair{1.8, 69.98e-3}, std::pair{9.0, 349.91e-3}})
    for (const WaveMode mode : kModes) {
      const Feed feed{{500, 255, 192}, mode, v_bus_V};
      const auto means = MeansOverTurn(motor, feed, {.rotor_stands = true});
      EXPECT_NEAR(std::sqrt(means.winding_W / (1.5 * 14.85)) / current_A, 1, 1e-3);
      EXPECT_EQ(means.mechanical_W, 0);
    }
}

TEST(MeansOverTurn, AWindingWithoutMemoryDrawsTheDutyOfTheBus) {
  MotorModel motor = WithoutEdges();
  motor.phase_inductance_H = 37e-9;
  constexpr double kVolt = 1.8;
  double duty = 0;
  for (int k = 0; k < 16; ++k) {  // 96 vectors, 16 of them a sector
    const double a = kPi / 3 * k / 16;
    duty += (std::sin(kPi / 3 - a) + std::sin(a)) / 16;
  }
  // A single leg against two in parallel, or two against one.
  const double power_W = kVolt * kVolt * 2 / 3 / 14.85 * duty;
  for (const WaveMode mode : kModes) {
    const auto means =
        MeansOverTurn(motor, {{65'000, 255, 96}, mode, kVolt}, {.rotor_stands = true});
    EXPECT_NEAR(means.winding_W / power_W, 1, 1e-4);
  }
}

TEST(MeansOverTurn, RippleHeatsAsThePeriodicPulseDoes) {
  // Six vectors: each is one pulse of sin(60 deg) a carrier. Periodic current between low and peak
  // i_inf (1 - exp(-ton/tau)) / (1 - exp(-T/tau)).
  const MotorModel motor = WithoutEdges();
  const double r = motor.phase_resistance_ohm;
  const double tau = motor.phase_inductance_H / r;
  for (const int counter1 : {250, 500, 1000, 2000}) {
    const double period = counter1 / kTimerHz;
    const double on = std::round(counter1 * std::sin(kPi / 3)) / kTimerHz;
    const double limit = 1.8 * 2 / 3 / r;
    const double peak = limit * (1 - std::exp(-on / tau)) / (1 - std::exp(-period / tau));
    const double low = peak * std::exp(-(period - on) / tau);
    const double off = low - limit;
    const double rising = limit * limit * on + 2 * limit * off * tau * (1 - std::exp(-on / tau)) +
                          off * off * tau / 2 * (1 - std::exp(-2 * on / tau));
    const double falling = peak * peak * tau / 2 * (1 - std::exp(-2 * (period - on) / tau));
    const Feed feed{{static_cast<std::uint16_t>(counter1), 255, 6}, WaveMode::kAsymmetric, 1.8};
    const auto means = MeansOverTurn(motor, feed, {.rotor_stands = true});
    // The remaining difference: between two vectors the current turns by 60 degrees, once in 255
    // carriers.
    EXPECT_NEAR(means.winding_W / (1.5 * r * (rising + falling) / period), 1, 4e-3) << counter1;
  }
}

TEST(MeansOverTurn, DeadTimeTakesItsShareOfTheFundamental) {
  // Slow winding, rotor at rest: no ripple, so the sign of a leg's current holds over a carrier.
  // Each leg loses dead time * carrier frequency * v_bus against that sign: a square wave of 4/pi
  // fundamental in phase with the current. |r i + loss + j x i| = v_bus / sqrt(3).
  MotorModel motor = WithoutEdges();
  motor.phase_inductance_H *= 400;
  const Feed feed{{2000, 255, 96}, WaveMode::kSevenSegment, 1.8};
  const double x = SpeedRadPerS(feed.drive) * motor.phase_inductance_H;
  const double r = motor.phase_resistance_ohm;
  const auto winding_W = [&](double dead_time_s) {
    motor.dead_time_s = dead_time_s;
    return MeansOverTurn(motor, feed, {.rotor_stands = true}).winding_W;
  };
  const double without_W = winding_W(0);
  for (const double dead_time_s : {20e-9, 40e-9, 80e-9}) {
    const double loss_V = 4 / kPi * dead_time_s * kTimerHz / 2000 * 1.8;
    double low_A = 0;
    double high_A = 0.1;
    for (int step = 0; step < 60; ++step) {
      const double middle = (low_A + high_A) / 2;
      const double voltage_V = std::hypot(r * middle + loss_V, x * middle);
      (voltage_V < 1.8 / std::numbers::sqrt3 ? low_A : high_A) = middle;
    }
    const double lost_W = without_W - 1.5 * r * low_A * low_A;
    EXPECT_NEAR((without_W - winding_W(dead_time_s)) / lost_W, 1, 0.06) << dead_time_s;
  }
}

TEST(MeansOverTurn, SwitchingIsOneHardEdgeForEachLegThatSwitches) {
  // As above, each leg's current has one sign over a carrier, so of its two edges one is hard. The
  // mean of |cos| is 2/pi. The leg that never rises (not with seven segments) is the one whose
  // current is most negative, 0.827 on average. 90 vectors: none with a leg that stays high. At the
  // border of two sectors one more leg, with half the current, does not rise.
  MotorModel motor;
  motor.phase_inductance_H *= 100;
  motor.dead_time_s = 0;
  const double current_A = 1.8 / std::numbers::sqrt3 / 14.85;
  const double a_leg_W = 0.5 * 1.8 * current_A * 10e-9 * kTimerHz / 2000;
  const auto switching = [&](WaveMode mode) {
    return MeansOverTurn(motor, {{2000, 255, 90}, mode, 1.8}, {.rotor_stands = true}).switching_W;
  };
  const double resting = 3 / kPi * std::sqrt(0.75) + 0.5 / 15;
  EXPECT_NEAR(switching(WaveMode::kSevenSegment) / (6 / kPi * a_leg_W), 1, 0.02);
  EXPECT_NEAR(switching(WaveMode::kAsymmetric) / ((6 / kPi - resting) * a_leg_W), 1, 0.02);
  EXPECT_NEAR(switching(WaveMode::kFiveSegment) / ((6 / kPi - resting) * a_leg_W), 1, 0.02);
}

// A phasor gives the same current in an independent way, the load angle found by bisection.
TEST(SteadyPower, OfASlowWindingIsThatOfThePhasorOfTheLoadAngle) {
  const std::uint64_t seed = test::TestSeed(7);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 40; ++k) {
    MotorModel motor = WithoutEdges();
    motor.phase_inductance_H *= 300;
    motor.flux_linkage_Wb = rng.Uniform(0.1e-3, 0.3e-3);
    motor.load_torque_Nm = rng.Uniform(0, 6e-6);
    const Feed feed{{1000, static_cast<std::uint8_t>(40 + rng.Below(200)), 96},
                    kModes[rng.Below(3)],
                    rng.Uniform(1.7, 3)};
    const double w = SpeedRadPerS(feed.drive);
    const double torque = motor.load_torque_Nm + motor.viscous_Nms * w;
    const std::complex<double> z(motor.phase_resistance_ohm, w * motor.phase_inductance_H);
    const auto current = [&](double lead) {
      // d axis real, q axis imaginary; back EMF on q; the voltage leads the d axis by `lead`.
      const std::complex<double> v = std::polar(feed.v_bus_V / std::numbers::sqrt3, lead);
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
    const MotorPower power = SteadyPower(motor, feed);
    EXPECT_FALSE(power.stalled);
    EXPECT_NEAR(power.winding_W / winding_W, 1, 3e-3) << k;
    const double pull_Nm = 1.5 * motor.flux_linkage_Wb * feed.v_bus_V / 1.732 / std::abs(z);
    EXPECT_NEAR(power.mechanical_W / w, torque, 1e-3 * pull_Nm) << k;
  }
}

TEST(SteadyPower, PullsItsLoadAtEveryPointThatItDoesNotCallStalled) {
  const std::uint64_t seed = test::TestSeed(11);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int stalled = 0;
  for (int k = 0; k < 100; ++k) {
    const Point p = RandomPoint(&rng);
    const double w = SpeedRadPerS(p.feed.drive);
    const double load_Nm = p.motor.load_torque_Nm + p.motor.viscous_Nms * w;
    const MotorPower power = SteadyPower(p.motor, p.feed);
    if (power.stalled) {
      ++stalled;
      for (double lag = -1.5; lag < 3.2; lag += 0.02) {
        const auto means = MeansOverTurn(p.motor, p.feed, {.lag_rad = lag});
        ASSERT_LT(means.torque_Nm, load_Nm * 1.001) << k << " lag " << lag;
      }
      continue;
    }
    const double pull_Nm = 1.5 * p.motor.flux_linkage_Wb * p.feed.v_bus_V / 1.732 / 14.85;
    EXPECT_NEAR(power.mechanical_W / w, load_Nm, 1e-3 * pull_Nm) << k;
  }
  EXPECT_GT(stalled, 0);
  EXPECT_LT(stalled, 60);
}

TEST(SteadyPower, StallsBeyondPullOutAndOnlyThere) {
  MotorModel motor = WithoutEdges();
  motor.phase_inductance_H *= 100;
  const Feed feed;
  const double w = SpeedRadPerS(feed.drive);
  const std::complex<double> z(motor.phase_resistance_ohm, w * motor.phase_inductance_H);
  const double voltage_V = 1.8 / std::numbers::sqrt3;
  // The circle's highest Iq: (V - w psi r / |z|) / |z|.
  const double current_A =
      (voltage_V - w * motor.flux_linkage_Wb * z.real() / std::abs(z)) / std::abs(z);
  const double most_Nm = 1.5 * motor.flux_linkage_Wb * current_A - motor.viscous_Nms * w;
  motor.load_torque_Nm = 0.995 * most_Nm;
  EXPECT_FALSE(SteadyPower(motor, feed).stalled);
  motor.load_torque_Nm = 1.005 * most_Nm;
  const MotorPower power = SteadyPower(motor, feed);
  EXPECT_TRUE(power.stalled);
  EXPECT_EQ(power.mechanical_W, 0);
  EXPECT_NEAR(power.winding_W / (1.5 * 14.85 * voltage_V * voltage_V / std::norm(z)), 1, 2e-3);
}

TEST(SteadyPower, SevenSegmentsSwitchMostAndHeatLeast) {
  const std::uint64_t seed = test::TestSeed(12);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 40; ++k) {
    Point p = RandomPoint(&rng);
    p.motor.load_torque_Nm = 2e-6;
    const auto with = [&](WaveMode mode) {
      p.feed.mode = mode;
      return SteadyPower(p.motor, p.feed);
    };
    const MotorPower seven = with(WaveMode::kSevenSegment);
    if (seven.stalled) continue;
    for (const WaveMode mode : {WaveMode::kAsymmetric, WaveMode::kFiveSegment}) {
      const MotorPower other = with(mode);
      EXPECT_GT(seven.switching_W, other.switching_W) << k;
      EXPECT_LT(seven.winding_W, other.winding_W) << k;  // less ripple, more dead time
    }
  }
}

TEST(SteadyPower, TheTunedMotorDrawsAboutATenthOfAWatt) {
  const MotorPower power = SteadyPower({}, {});
  EXPECT_NEAR(power.winding_W, 0.1, 0.015);  // I = 69.98 mA: 1.5 r I^2 = 0.109 W, less the back EMF
  EXPECT_NEAR(power.mechanical_W, 5.8e-6 * 174.5, 2e-5);
  EXPECT_LT(power.switching_W, 0.03 * power.winding_W);
}

TEST(SteadyPower, IsTotalOverUnreasonableSettings) {
  for (const AxisDrive& drive :
       {AxisDrive{1, 1, 6}, AxisDrive{7, 3, 1}, AxisDrive{10, 255, 7}, AxisDrive{65'535, 255, 96},
        AxisDrive{12, 4, 3000}, AxisDrive{500, 1, 5000}}) {
    for (const WaveMode mode : kModes) {
      const MotorPower power = SteadyPower({}, {drive, mode, 60});
      EXPECT_TRUE(std::isfinite(power.total_W()));
      EXPECT_GE(power.winding_W, 0);
    }
  }
}

TEST(DrivePowers, GivesWhatSteadyPowerGives) {
  DrivePowers powers(MotorModel{});
  const Feed slow{{500, 200, 96}, WaveMode::kFiveSegment, 1.8};
  const Feed fast{{500, 50, 96}, WaveMode::kFiveSegment, 1.8};
  for (int k = 0; k < 2; ++k)
    for (const Feed& feed : {slow, fast})
      EXPECT_EQ(powers.Of(feed).total_W(), SteadyPower({}, feed).total_W());
}

}  // namespace
}  // namespace focalfleet
