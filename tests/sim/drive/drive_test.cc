// The drive against closed forms, against an integration in small steps with its own bridge, and
// against its own balance of energy.
#include "sim/drive/drive.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "protocol/base/rng.h"
#include "sim/drive/steady.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using ::focalfleet::test::TestSeed;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr Bridge kIdeal9V{.v_bus_V = 9, .rise_s = 0, .fall_s = 0, .dead_time_s = 0};

Drive::Setting Setting(const Bridge& bridge, const char* set = "9") {
  return {*FindParameterSet(set), {}, bridge};
}

// A rotor that stays at rest under any torque.
Drive::Setting Blocked(const Bridge& bridge) {
  Drive::Setting setting = Setting(bridge);
  setting.motor.load_Nm = 1;
  return setting;
}

TEST(Drive, PeakOfABlockedMotorIsThePeriodicOneOfItsLongestPulse) {
  // The expected current is i = 2 V / (3 r) (1 - e^(-on / tau)) / (1 - e^(-T / tau)). Vector 100
  // alone is on for sin 60 of the period.
  for (const int counter1 : {250, 500, 1000, 2000}) {
    const Modulation modulation{.counter1 = counter1, .repeat = 40, .subdivision = 6};
    const auto setting = Blocked(kIdeal9V);
    Drive drive(setting);
    drive.Place(0, 0);
    for (int k = 0; k < 40; ++k) drive.RunCarrier(PatternOf(modulation, 0), modulation);
    const double tau_s = setting.motor.inductance_H / setting.motor.resistance_ohm;
    const double on_s = std::round(counter1 * std::sin(std::numbers::pi / 3)) / 144e6;
    const double expected = 2 * 9 / (3 * setting.motor.resistance_ohm) *
                            -std::expm1(-on_s / tau_s) /
                            -std::expm1(-modulation.carrier_s() / tau_s);
    EXPECT_NEAR(drive.peak_A() / expected, 1, 1e-9) << counter1;
  }
}

TEST(Drive, PeaksAreThoseOfTheIndependentCalculation) {
  // The figures are for a blocked motor and one at 375 Hz, set 9 at its worst load, asymmetric.
  // They come from an independent PWM-resolved calculation and have three digits.
  const int counter1[] = {250, 500, 1000, 2000};
  const double turning_mA[] = {335, 352, 372, 392};
  const double blocked_mA[] = {359, 376, 392, 402};
  for (std::size_t k = 0; k < 4; ++k) {
    const Modulation modulation{.counter1 = counter1[k], .repeat = 4000 / counter1[k]};
    const auto setting = Setting({.v_bus_V = 9});
    const auto state = FindSteadyState(setting, modulation, 1.2 * setting.motor.load_Nm);
    ASSERT_TRUE(state);
    EXPECT_NEAR(1e3 * MeasureSteadyWave(setting, modulation, *state).peak_A / turning_mA[k], 1,
                0.005);
    Drive drive(Blocked({.v_bus_V = 9}));
    drive.Place(0, 0);
    RunVectors(&drive, modulation, VectorTable(modulation), 0, 192);
    EXPECT_NEAR(1e3 * drive.peak_A() / blocked_mA[k], 1, 0.005);
  }
}

TEST(Drive, EnergyIsAccountedForWhateverTheSetting) {
  for (std::uint64_t trial = 0; trial < 60; ++trial) {
    const std::uint64_t seed = TestSeed(100 + trial);
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    const int counter1[] = {250, 333, 500, 1000, 2000};
    const int subdivision[] = {6, 12, 24, 48, 96};
    const Modulation modulation{.counter1 = counter1[rng.Below(5)],
                                .repeat = 4 + static_cast<int>(rng.Below(100)),
                                .subdivision = subdivision[rng.Below(5)],
                                .mode = static_cast<WaveMode>(rng.Below(3))};
    Drive::Setting setting = Setting({.v_bus_V = rng.Uniform(1.7, 9.2),
                                      .rise_s = rng.Uniform(0, 20e-9),
                                      .fall_s = rng.Uniform(0, 20e-9),
                                      .dead_time_s = rng.Uniform(0, 150e-9)},
                                     kParameterSets[rng.Below(5)].name.data());
    setting.gearhead.play_rad = rng.Below(2) == 0 ? 0 : rng.Uniform(0, 40);
    Drive drive(setting);
    drive.Place(rng.Uniform(-1, 0), 0);
    const double stored_before = drive.energy().stored_J;
    RunVectors(&drive, modulation, VectorTable(modulation), 0, 200'000 / (modulation.repeat * 10));
    const DriveEnergy energy = drive.energy();
    const double out = energy.copper_J + energy.switching_J + energy.load_J + energy.viscous_J +
                       energy.stored_J - stored_before;
    EXPECT_LT(std::abs(energy.supply_J - out), 1e-6 * energy.supply_J)
        << energy.supply_J << " in, " << out << " out";
    EXPECT_GE(energy.switching_J, 0);
  }
}

// ---- the same circuit in small steps, each phase by itself; no dead time

struct SmallSteps {
  std::vector<double> current_a_A;  // at the end of each carrier period
};

SmallSteps Integrate(const Drive::Setting& setting, const Modulation& modulation, double begin_rad,
                     double speed, int vectors) {
  SmallSteps out;
  const MotorParameters& motor = setting.motor;
  std::array<double, 3> current{};
  double t_s = 0;
  const auto rate = [&](const std::array<double, 3>& i, const std::array<double, 3>& leg_V,
                        double at_s) {
    const double star_V = (leg_V[0] + leg_V[1] + leg_V[2]) / 3;
    std::array<double, 3> change;
    for (std::size_t k = 0; k < 3; ++k) {
      const double angle = begin_rad + speed * at_s - kTurn / 3 * static_cast<double>(k);
      const double emf_V = -speed * motor.flux_linkage_Wb * std::sin(angle);
      change[k] = (leg_V[k] - star_V - motor.resistance_ohm * i[k] - emf_V) / motor.inductance_H;
    }
    return change;
  };
  for (int vector = 0; vector < vectors; ++vector) {
    const Pattern pattern = PatternOf(modulation, vector % modulation.subdivision);
    for (int n = 0; n < modulation.repeat; ++n) {
      for (int count = 0; count < modulation.counter1; ++count) {
        std::array<double, 3> leg_V;
        for (std::size_t k = 0; k < 3; ++k)
          leg_V[k] = count >= pattern[k].on && count < pattern[k].off ? setting.bridge.v_bus_V : 0;
        const double step_s = 1 / modulation.clock_Hz;
        const auto k1 = rate(current, leg_V, t_s);
        std::array<double, 3> middle;
        for (std::size_t k = 0; k < 3; ++k) middle[k] = current[k] + k1[k] * step_s / 2;
        const auto k2 = rate(middle, leg_V, t_s + step_s / 2);
        for (std::size_t k = 0; k < 3; ++k) middle[k] = current[k] + k2[k] * step_s / 2;
        const auto k3 = rate(middle, leg_V, t_s + step_s / 2);
        std::array<double, 3> last;
        for (std::size_t k = 0; k < 3; ++k) last[k] = current[k] + k3[k] * step_s;
        const auto k4 = rate(last, leg_V, t_s + step_s);
        for (std::size_t k = 0; k < 3; ++k)
          current[k] += step_s / 6 * (k1[k] + 2 * k2[k] + 2 * k3[k] + k4[k]);
        t_s += step_s;
      }
      out.current_a_A.push_back(current[0]);
    }
  }
  return out;
}

TEST(Drive, CurrentsAreThoseOfAnIntegrationInSmallSteps) {
  for (const WaveMode mode :
       {WaveMode::kAsymmetric, WaveMode::kFiveSegment, WaveMode::kSevenSegment}) {
    const Modulation modulation{.repeat = 4, .subdivision = 48, .mode = mode};
    Drive::Setting setting = Setting(kIdeal9V);
    setting.motor.inertia_kg_m2 = 1e9;
    const double speed = kTurn * modulation.field_Hz();
    Drive drive(setting);
    drive.Place(-0.5, speed);
    const SmallSteps reference = Integrate(setting, modulation, -0.5, speed, 48);
    std::size_t at = 0;
    for (int vector = 0; vector < 48; ++vector)
      for (int n = 0; n < modulation.repeat; ++n, ++at) {
        drive.RunCarrier(PatternOf(modulation, vector), modulation);
        ASSERT_NEAR(drive.current_A().real(), reference.current_a_A[at], 2e-8)
            << Name(mode) << " carrier " << at;
      }
  }
}

TEST(Drive, DeadTimeTakesVoltageFromAPulseAndGivesItToItsFall) {
  // The rotor is blocked and one leg pulses. Current flows out of that leg, so its rise waits and
  // its fall does not; the two others stay low.
  const Modulation modulation{.repeat = 40, .subdivision = 6};
  const auto mean = [&](double dead_s) {
    Bridge bridge = kIdeal9V;
    bridge.dead_time_s = dead_s;
    Drive drive(Blocked(bridge));
    drive.Place(0, 0);
    for (int k = 0; k < 40; ++k) drive.RunCarrier(PatternOf(modulation, 0), modulation);
    double charge = 0;
    drive.Listen([&](const DriveInterval& x) { charge += x.moments[0].real(); });
    drive.RunCarrier(PatternOf(modulation, 0), modulation);
    return charge / modulation.carrier_s();
  };
  const double lost_A = 2.0 / 3 * 9 * 50e-9 / modulation.carrier_s() / 14.85;
  EXPECT_NEAR((mean(0) - mean(50e-9)) / lost_A, 1, 1e-6);
}

TEST(Drive, CurrentThatDiesInADiodeLeavesTheLegFloating) {
  // Pulses are short against a long dead time: the current ends within it and must not reverse.
  Bridge bridge = kIdeal9V;
  bridge.dead_time_s = 12e-6;
  const Modulation modulation{.counter1 = 4000};
  const Pattern pattern{{{0, 1800}, {4000, 4000}, {4000, 4000}}};
  Drive drive(Blocked(bridge));
  drive.Place(0, 0);
  double lowest = 0;
  double highest = 0;
  drive.Probe(1e-7, [&](const DriveSample& sample) {
    lowest = std::min(lowest, sample.current_A[0]);
    highest = std::max(highest, sample.current_A[0]);
    EXPECT_NEAR(sample.current_A[0] + sample.current_A[1] + sample.current_A[2], 0, 1e-15);
  });
  for (int k = 0; k < 20; ++k) drive.RunCarrier(pattern, modulation);
  EXPECT_GT(highest, 0.01);
  EXPECT_GE(lowest, -1e-12);
}

TEST(Drive, ProbingChangesNothing) {
  const Modulation modulation{.repeat = 8};
  const auto run = [&](bool probed) {
    Drive drive(Setting({.v_bus_V = 9}));
    drive.Place(0, 0);
    if (probed) drive.Probe(3.3e-8, [](const DriveSample&) {});
    RunVectors(&drive, modulation, VectorTable(modulation), 0, 500);
    return std::pair(drive.current_A(), drive.shaft().angle_rad());
  };
  EXPECT_EQ(run(false), run(true));
}

// ---- steady rotation

TEST(SteadyState, HoldsItsPlaceWithItsOwnInertia) {
  const Modulation modulation{.repeat = 37};
  auto setting = Setting({.v_bus_V = 1.8});
  setting.motor.load_variation = 0;
  const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
  ASSERT_TRUE(state);
  Drive drive = InSteadyRotation(setting, modulation, *state);
  const double begin_rad = drive.shaft().angle_rad();
  RunVectors(&drive, modulation, VectorTable(modulation), 0, 20 * 96);
  EXPECT_NEAR(drive.shaft().angle_rad() - begin_rad, 20 * kTurn, 0.02);
}

TEST(SteadyState, RefusesALoadBeyondPullOut) {
  const Modulation modulation{.repeat = 37};
  const auto setting = Setting({.v_bus_V = 1.8});
  EXPECT_FALSE(FindSteadyState(setting, modulation, 40e-6));
}

TEST(SteadyState, PowerBalancesAndTheFiguresMoveWithTheResistance) {
  const Modulation modulation{.repeat = 108};
  auto setting = Setting({.v_bus_V = 1.8});
  const auto measure = [&] {
    const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
    return MeasureSteadyWave(setting, modulation, *state);
  };
  const WaveFigures figures = measure();
  EXPECT_NEAR(figures.power.copper_W + figures.power.switching_W + figures.power.mechanical_W,
              figures.power.supply_W, 1e-6 * figures.power.supply_W);
  EXPECT_NEAR(figures.peak_A, 73.5e-3, 0.005 * 73.5e-3) << "independent calculation";
  setting.motor.resistance_ohm *= 1.1;
  EXPECT_LT(measure().peak_A, 0.97 * figures.peak_A);
}

}  // namespace
}  // namespace focalfleet::sim
