#include "sim/drive/svpwm.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

namespace focalfleet::sim {
namespace {

constexpr WaveMode kModes[] = {WaveMode::kAsymmetric, WaveMode::kFiveSegment,
                               WaveMode::kSevenSegment};

// The mean voltage of a carrier period in the plane. Units: the bus voltage.
std::complex<double> MeanVector(const Pattern& pattern, double period) {
  std::complex<double> sum;
  for (std::size_t leg = 0; leg < kLegCount; ++leg) {
    const double width = pattern[leg].none() ? 0 : pattern[leg].off - pattern[leg].on;
    sum += 2.0 / 3 * width / period *
           std::polar(1.0, 2 * std::numbers::pi / 3 * static_cast<double>(leg));
  }
  return sum;
}

TEST(Svpwm, EveryVectorOfEveryModeHasTheVoltSecondsOfItsAngle) {
  for (const WaveMode mode : kModes)
    for (const int subdivision : {6, 12, 24, 48, 96, 192})
      for (const int counter1 : {250, 500, 999, 2000}) {
        const Modulation modulation{.counter1 = counter1, .subdivision = subdivision, .mode = mode};
        for (int k = 0; k < subdivision; ++k) {
          const auto wanted =
              std::polar(1 / std::numbers::sqrt3, 2 * std::numbers::pi * k / subdivision);
          // Rounding moves each of three widths by half a count.
          EXPECT_LT(std::abs(MeanVector(PatternOf(modulation, k), counter1) - wanted),
                    0.75 / counter1)
              << Name(mode) << " subdivision " << subdivision << " vector " << k;
        }
      }
}

TEST(Svpwm, OneLegAtATimeSwitchesAndCountsAreWhole) {
  for (const WaveMode mode : kModes) {
    const Modulation modulation{.subdivision = 96, .mode = mode};
    for (int k = 0; k < 96; ++k) {
      int switching = 0;
      for (const Pulse& pulse : PatternOf(modulation, k)) {
        EXPECT_EQ(pulse.on, std::floor(pulse.on));
        EXPECT_EQ(pulse.off, std::floor(pulse.off));
        EXPECT_GE(pulse.on, 0);
        EXPECT_LE(pulse.off, 500);
        switching += pulse.none() ? 0 : 1;
      }
      EXPECT_LE(switching, mode == WaveMode::kSevenSegment ? 3 : 2) << "vector " << k;
    }
  }
}

TEST(Svpwm, ModesDifferOnlyInWhereThePartsLie) {
  const auto pattern = [](WaveMode mode) {
    return PatternOf({.subdivision = 96, .mode = mode}, 5);
  };
  const Pattern asymmetric = pattern(WaveMode::kAsymmetric);
  EXPECT_EQ(asymmetric[0].off, 500);
  EXPECT_EQ(asymmetric[1].off, 500);
  EXPECT_TRUE(asymmetric[2].none());
  for (const WaveMode mode : {WaveMode::kFiveSegment, WaveMode::kSevenSegment})
    for (const Pulse& pulse : pattern(mode))
      if (!pulse.none()) {
        EXPECT_NEAR(pulse.on + pulse.off, 500, 1) << "not centred";
      }
  EXPECT_FALSE(pattern(WaveMode::kSevenSegment)[2].none());
}

TEST(Svpwm, TimesAreThoseOfThePaper) {
  const Modulation critical{.repeat = 37};
  EXPECT_NEAR(critical.vector_s() * 96 * 337 * 45 / 17, 11.002, 1e-3);
  EXPECT_NEAR(Modulation{}.vector_s() * 96 * 337 * 45 / 17, 32.114, 1e-3);
}

}  // namespace
}  // namespace focalfleet::sim
