#include "sim/drive/scope/recording.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace focalfleet::sim {
namespace {

Drive::Setting Bare(double v_bus_V) {
  MotorParameters motor = *FindParameterSet("9");
  motor.load_Nm = kBareLoad_Nm;
  motor.load_variation = 0;
  return {motor, {}, {.v_bus_V = v_bus_V}};
}

void ExpectNear(double value, double wanted, double share) {
  EXPECT_NEAR(value, wanted, share * std::abs(wanted));
}

// Exact integrals over a rotor held at its speed are compared with samples of one with its own
// inertia.
TEST(Recording, InStepAgreesWithTheExactFiguresOfSteadyRotation) {
  for (const WaveMode mode :
       {WaveMode::kAsymmetric, WaveMode::kFiveSegment, WaveMode::kSevenSegment}) {
    const Drive::Setting setting = Bare(9);
    const Modulation modulation{.repeat = 8, .mode = mode};
    const Recording seen = Record(setting, modulation, {});
    const auto state = FindSteadyState(setting, modulation, setting.motor.load_Nm);
    ASSERT_TRUE(state);
    const WaveFigures exact = MeasureSteadyWave(setting, modulation, *state);
    EXPECT_TRUE(seen.in_step);
    ExpectNear(seen.lag_rad, state->lag_rad, 0.01);
    ExpectNear(seen.speed_rad_per_s, state->speed_rad_per_s, 1e-3);
    ExpectNear(seen.figures.peak_A, exact.peak_A, 1e-3);
    ExpectNear(seen.figures.rms_A, exact.rms_A, 2e-4);
    ExpectNear(seen.figures.fundamental_A, exact.fundamental_A, 5e-4);
    EXPECT_NEAR(seen.figures.snr_dB, exact.snr_dB, 0.01);
    ExpectNear(seen.figures.thd, exact.thd, 2e-3);
    ExpectNear(seen.figures.torque_ripple_rms, exact.torque_ripple_rms, 0.05);
    ExpectNear(seen.figures.power.supply_W, exact.power.supply_W, 1e-3);
    ExpectNear(seen.figures.power.switching_W, exact.power.switching_W, 2e-3);
    ExpectNear(seen.figures.edges_per_carrier, exact.edges_per_carrier, 2e-3);
  }
}

TEST(Recording, SamplesAreEvenlySpacedAndTellTheSameCurrent) {
  const Recording seen = Record(Bare(9), {.repeat = 8}, {.turns = 3});
  ASSERT_EQ(seen.samples.size(), 3u * 32768);
  double square = 0;
  double peak = 0;
  for (std::size_t k = 0; k < seen.samples.size(); ++k) {
    const DriveSample& sample = seen.samples[k];
    EXPECT_NEAR(sample.t_s, static_cast<double>(k) * seen.sample_s, 1e-12);
    EXPECT_NEAR(sample.current_A[0] + sample.current_A[1] + sample.current_A[2], 0, 1e-15);
    for (const double current : sample.current_A) {
      square += current * current / 3;
      peak = std::max(peak, std::abs(current));
    }
  }
  ExpectNear(std::sqrt(square / static_cast<double>(seen.samples.size())), seen.figures.rms_A,
             2e-4);
  EXPECT_LE(peak, seen.figures.peak_A * (1 + 1e-12));
  ExpectNear(peak, seen.figures.peak_A, 5e-3);
}

TEST(Recording, AnotherSampleTimeGivesTheSameSpectrum) {
  const Recording by_default = Record(Bare(9), {.repeat = 8}, {});
  const Recording finer = Record(Bare(9), {.repeat = 8}, {.sample_s = 50e-9});
  EXPECT_EQ(finer.samples.size(), 106667u);
  ExpectNear(finer.figures.fundamental_A, by_default.figures.fundamental_A, 1e-5);
  EXPECT_NEAR(finer.figures.snr_dB, by_default.figures.snr_dB, 1e-3);
  const auto near_carrier = [](const Recording& recording) {
    const auto carrier = recording.harmonics_A.begin() + 96 * 8;
    return *std::max_element(carrier - 8, carrier + 8);
  };
  ExpectNear(near_carrier(finer), near_carrier(by_default), 0.01);
}

TEST(Recording, EnergyCloses) {
  for (const RecordingPlan& plan :
       {RecordingPlan{}, RecordingPlan{.from_rest = true, .turns_to_judge = 2}})
    EXPECT_LT(std::abs(Record(Bare(9), {.repeat = 12}, plan).energy_balance()), 1e-6);
}

TEST(Recording, FromRestTheCriticalRepeatTurnsAndOneLessStalls) {
  // The sets were fitted without dead time and ramps, so the bridge has none.
  const Drive::Setting setting{
      *FindParameterSet("9"), {}, {.rise_s = 0, .fall_s = 0, .dead_time_s = 0}};
  const Recording turns = Record(setting, {.repeat = 37}, {.turns = 1, .from_rest = true});
  EXPECT_TRUE(turns.in_step);
  ExpectNear(turns.speed_rad_per_s * 30 / std::numbers::pi, 4864.9, 0.02);
  const Recording stalls = Record(setting, {.repeat = 36}, {.turns = 1, .from_rest = true});
  EXPECT_FALSE(stalls.in_step);
  EXPECT_GT(stalls.lag_rad, 2 * std::numbers::pi);
}

TEST(Recording, ARampStartsWhatWouldStallAndSlowsDownForNothing) {
  const Drive::Setting setting = Bare(9);
  const RecordingPlan at_once{.turns = 1, .from_rest = true};
  RecordingPlan ramped = at_once;
  ramped.ramp = {.stages = 6, .stage_s = 0.02};
  EXPECT_FALSE(Record(setting, {.repeat = 6}, at_once).in_step);
  const Recording turns = Record(setting, {.repeat = 6}, ramped);
  EXPECT_TRUE(turns.in_step);
  ExpectNear(turns.speed_rad_per_s * 30 / std::numbers::pi, 30000, 0.02);
}

TEST(Recording, ALoadThatNoLagHoldsIsAStall) {
  Drive::Setting setting = Bare(1.8);
  setting.motor.load_Nm = 100e-6;
  for (const bool from_rest : {false, true}) {
    const Recording seen =
        Record(setting, {}, {.turns = 1, .from_rest = from_rest, .turns_to_judge = 2});
    EXPECT_FALSE(seen.in_step);
    EXPECT_NEAR(seen.speed_rad_per_s, 0, 1);
    EXPECT_TRUE(std::isnan(seen.figures.torque_ripple_rms));
  }
}

TEST(Recording, SizeIsReportedBeforehand) {
  const Modulation modulation{.repeat = 8};
  const RecordingPlan plan{.from_rest = true, .ramp = {.stages = 2, .stage_s = 0.01}};
  const RecordingSize size = SizeOf(modulation, plan);
  const Recording seen = Record(Bare(9), modulation, plan);
  EXPECT_NEAR(static_cast<double>(seen.samples.size()), size.samples, 1);
  EXPECT_NEAR(seen.vectors.back().t_s, size.carriers * modulation.carrier_s(), 1e-9);
}

}  // namespace
}  // namespace focalfleet::sim
