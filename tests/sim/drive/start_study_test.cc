#include "sim/drive/start_study.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <numbers>
#include <numeric>

#include "protocol/base/rng.h"
#include "sim/drive/steady.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using ::focalfleet::test::TestSeed;

// The five sets were fitted without dead time and ramps.
Drive::Setting Ideal(const MotorParameters& motor, double v_bus_V) {
  return {motor, {}, {.v_bus_V = v_bus_V, .rise_s = 0, .fall_s = 0, .dead_time_s = 0}};
}

TEST(StartStudy, EverySetIsCriticalAt37AtBothLevels) {
  for (const ParameterSet& set : kParameterSets) {
    const auto setting = Ideal(set.motor, 1.8);
    EXPECT_EQ(CriticalRepeat(setting, {}, {}, DriveLevel::kReduced), 37) << set.name;
    EXPECT_TRUE(StartsAtWorstLoad(setting, {.repeat = 37}, {}, DriveLevel::kPwm)) << set.name;
    EXPECT_FALSE(StartsAtWorstLoad(setting, {.repeat = 36}, {}, DriveLevel::kPwm)) << set.name;
  }
}

TEST(StartStudy, WholeMovesDecideAsTheWorstStartDoes) {
  const auto setting = Ideal(*FindParameterSet("C"), 1.8);
  const MoveCount at_37 = TryMoves(setting, {.repeat = 37}, {}, DriveLevel::kReduced);
  EXPECT_EQ(at_37.moves, 12);
  EXPECT_TRUE(at_37.all());
  EXPECT_FALSE(TryMoves(setting, {.repeat = 36}, {}, DriveLevel::kReduced).all());
}

TEST(StartStudy, LevelsAgreeOnTheCriticalRepeatOverVoltagesWithinOne) {
  for (const char* name : {"V", "9"})
    for (const double v_bus_V : {1.7, 2.5, 5.0, 9.2}) {
      const Drive::Setting setting{*FindParameterSet(name), {}, {.v_bus_V = v_bus_V}};
      const auto reduced = CriticalRepeat(setting, {}, {}, DriveLevel::kReduced, 60);
      ASSERT_TRUE(reduced);
      const auto starts = [&](int repeat) {
        return StartsAtWorstLoad(setting, {.repeat = repeat}, {}, DriveLevel::kPwm);
      };
      EXPECT_TRUE(starts(*reduced + 1)) << name << " at " << v_bus_V << " V, n " << *reduced;
      EXPECT_FALSE(starts(*reduced - 2)) << name << " at " << v_bus_V << " V, n " << *reduced;
    }
}

TEST(StartStudy, MoreLoadMoreResistanceAndLessVoltageNeedMoreTime) {
  const auto critical = [](double load, double resistance, double v_bus_V) {
    auto motor = *FindParameterSet("V");
    motor.load_Nm *= load;
    motor.resistance_ohm *= resistance;
    return CriticalRepeat(Ideal(motor, v_bus_V), {}, {}, DriveLevel::kReduced).value_or(1000);
  };
  EXPECT_GT(critical(1.1, 1, 1.8), 37);
  EXPECT_GT(critical(1, 1.1, 1.8), 37);
  EXPECT_GT(critical(1, 1, 1.7), 37);
  EXPECT_LT(critical(0.9, 1, 1.8), 37);
}

TEST(StartStudy, ALoadBeyondStallNeverStarts) {
  auto motor = *FindParameterSet("V");
  motor.load_Nm = 50e-6;
  EXPECT_FALSE(CriticalRepeat(Ideal(motor, 1.8), {}, {}, DriveLevel::kReduced));
  EXPECT_FALSE(StartsAtWorstLoad(Ideal(motor, 1.8), {}, {}, DriveLevel::kPwm));
}

TEST(StartStudy, TheLoadIsFoundAgainFromTheCriticalRepeat) {
  const auto setting = Ideal(*FindParameterSet("9"), 1.8);
  // Between 36 and 37 lies 1 % of the load.
  EXPECT_NEAR(LoadOfCriticalRepeat(setting, {}, 37) / setting.motor.load_Nm, 1, 0.02);
}

TEST(StartStudy, ARampStartsWhatAStepCannot) {
  const auto setting = Ideal(*FindParameterSet("C"), 1.8);
  const Modulation fast{.repeat = 25};
  for (const DriveLevel level : {DriveLevel::kReduced, DriveLevel::kPwm}) {
    EXPECT_FALSE(StartsAtWorstLoad(setting, fast, {}, level));
    EXPECT_TRUE(StartsAtWorstLoad(setting, fast, {.ramp = {.stages = 8, .stage_s = 0.02}}, level));
  }
}

TEST(Profile, AddsUpAndMirrors) {
  for (const std::int64_t vectors : {0, 1, -1, 7, -200, 71'365, -71'365})
    for (const int stages : {0, 1, 4, 14}) {
      const auto profile = MakeProfile(vectors, {.repeat = 20}, {.stages = stages});
      std::int64_t sum = 0;
      for (std::size_t k = 0; k < profile.size(); ++k) {
        sum += profile[k].vectors;
        EXPECT_EQ(profile[k].repeat, profile[profile.size() - 1 - k].repeat);
        EXPECT_GE(profile[k].repeat, 20);
      }
      EXPECT_EQ(sum, vectors);
    }
}

// ---- the reduced drive against PWM level

struct Compared {
  double angle_deg = 0;  // of the rotor, electrical; the largest difference
  double power = 0;      // of the mean supply power, relative
};

Compared Compare(const Drive::Setting& setting, const Modulation& modulation, int turns) {
  const auto table = VectorTable(modulation);
  Drive pwm(setting);
  ReducedDrive reduced(setting, modulation);
  pwm.Place(-0.5, 0);
  reduced.Place(-0.5, 0);
  Compared worst;
  for (int k = 0; k < turns * modulation.subdivision; ++k) {
    RunVectors(&pwm, modulation, table, k, 1);
    reduced.RunVectors(k, 1);
    worst.angle_deg =
        std::max(worst.angle_deg, std::abs(pwm.shaft().angle_rad() - reduced.shaft().angle_rad()) *
                                      180 / std::numbers::pi);
  }
  worst.power = reduced.supply_J() / pwm.energy().supply_J - 1;
  return worst;
}

TEST(ReducedDrive, FollowsTheDriveAtPwmLevel) {
  double angle_deg = 0;
  double power = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    const std::uint64_t seed = TestSeed(300 + k);
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    const Drive::Setting setting{
        kParameterSets[rng.Below(5)].motor, {}, {.v_bus_V = rng.Uniform(1.7, 9.2)}};
    Modulation modulation{.subdivision = 12 << rng.Below(4),
                          .mode = static_cast<WaveMode>(rng.Below(3))};
    // n is well above critical: near it the outcome depends on tiny differences, and the levels may
    // differ.
    const int critical = CriticalRepeat(setting, {}, {}, DriveLevel::kReduced).value_or(100);
    modulation.repeat = critical * 96 * 3 / 2 / modulation.subdivision;
    const Compared compared = Compare(setting, modulation, 12);
    EXPECT_LT(compared.angle_deg, 6);
    EXPECT_LT(std::abs(compared.power), 0.02);
    angle_deg = std::max(angle_deg, compared.angle_deg);
    power = std::max(power, std::abs(compared.power));
  }
  RecordProperty("largest_angle_deg", std::to_string(angle_deg));
  RecordProperty("largest_power_error", std::to_string(power));
}

TEST(ReducedDrive, FollowsTheDriveUpAndDownARamp) {
  double angle_deg = 0;
  double power = 0;
  for (std::uint64_t k = 0; k < 10; ++k) {
    const std::uint64_t seed = TestSeed(330 + k);
    FOCALFLEET_TRACE_SEED(seed);
    Rng rng(seed);
    const Drive::Setting setting{
        kParameterSets[rng.Below(5)].motor, {}, {.v_bus_V = rng.Uniform(1.7, 9.2)}};
    Modulation modulation{.mode = static_cast<WaveMode>(rng.Below(3))};
    const Ramp ramp{.stages = static_cast<int>(2 + rng.Below(7)),
                    .stage_s = rng.Uniform(5e-3, 20e-3)};
    // n is well above the one that starts with the ramp, and for most below the one that starts
    // without it.
    const int critical =
        CriticalRepeat(setting, modulation, {.ramp = ramp}, DriveLevel::kReduced).value_or(100);
    modulation.repeat = critical * 5 / 4 + 1;
    Drive pwm(setting);
    ReducedDrive reduced(setting, modulation);
    pwm.Place(-0.5, 0);
    reduced.Place(-0.5, 0);
    const std::vector<Pattern> table = VectorTable(modulation);
    std::int64_t field = 0;
    double worst_deg = 0;
    for (const Stage& stage : MakeProfile(96 * 60, modulation, ramp)) {
      Modulation at = modulation;
      at.repeat = stage.repeat;
      for (std::int64_t v = 0; v < stage.vectors; ++v, ++field) {
        RunVectors(&pwm, at, table, field, 1);
        reduced.RunVectors(field, 1, stage.repeat);
        worst_deg =
            std::max(worst_deg, std::abs(pwm.shaft().angle_rad() - reduced.shaft().angle_rad()) *
                                    180 / std::numbers::pi);
      }
    }
    const double energy = reduced.supply_J() / pwm.energy().supply_J - 1;
    EXPECT_LT(worst_deg, 6) << "n " << modulation.repeat << ", " << ramp.stages << " stages";
    EXPECT_LT(std::abs(energy), 0.02);
    angle_deg = std::max(angle_deg, worst_deg);
    power = std::max(power, std::abs(energy));
  }
  RecordProperty("largest_angle_deg", std::to_string(angle_deg));
  RecordProperty("largest_energy_error", std::to_string(power));
}

}  // namespace
}  // namespace focalfleet::sim
