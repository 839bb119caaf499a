// Torques whose running mean is known: a line and a sinusoid.
#include "sim/drive/torque_ripple.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

namespace focalfleet::sim {
namespace {

// Feeds `torque` in intervals of `step_s`, each with its exact impulse and moment (Gauss, three
// points).
void Feed(TorqueRipple* ripple, const std::function<double(double)>& torque, double step_s,
          int steps) {
  const double x = std::sqrt(0.6);
  for (int k = 0; k < steps; ++k) {
    DriveInterval interval{.t_s = k * step_s, .step_s = step_s};
    for (const auto& [at, weight] : {std::pair(-x, 5.0), std::pair(0.0, 8.0), std::pair(x, 5.0)}) {
      const double t = step_s / 2 * (1 + at);
      const double part = weight / 18 * step_s * torque(k * step_s + t);
      interval.impulse_Nms += part;
      interval.moment_Nms2 += part * t;
    }
    ripple->Hear(interval);
  }
}

TEST(TorqueRipple, OfASinusoidIsItLessWhatTheWindowTakes) {
  // A window of a share s of the period leaves sin(pi s) / (pi s) of the amplitude.
  constexpr double kPeriod_s = 16e-6;
  constexpr double kShare = 0.25;
  TorqueRipple ripple(kShare * kPeriod_s);
  // A window has 17 steps, so windows do not begin where steps do.
  Feed(
      &ripple, [](double t) { return 3 + 2 * std::sin(2 * std::numbers::pi * t / kPeriod_s); },
      kPeriod_s / 68.5, 20 * 137 / 2);
  const double left = std::sin(std::numbers::pi * kShare) / (std::numbers::pi * kShare);
  const TorqueRipple::Figures figures = ripple.Judge();
  EXPECT_NEAR(figures.mean_Nm, 3, 1e-9);
  EXPECT_NEAR(figures.peak_to_peak * figures.mean_Nm, 4 * left, 4e-3);
  EXPECT_NEAR(figures.rms * figures.mean_Nm, 2 * left / std::sqrt(2), 1e-2);
}

TEST(TorqueRipple, PeaksLieWhereverTheyAreNotWhereWindowsBegin) {
  // The pulse is a window long and lies between two borders of windows: means over windows would
  // see half of it.
  TorqueRipple ripple(1e-6);
  Feed(
      &ripple, [](double t) { return t > 2.5e-6 && t < 3.5e-6 ? 2.0 : 1.0; }, 0.5e-6, 12);
  EXPECT_NEAR(ripple.Judge().peak_to_peak, 1 / (7.0 / 6), 1e-6);
}

TEST(TorqueRipple, LongIntervalsKeepTheirSlope) {
  // The winding's charging is a sawtooth, with an interval for each tooth: its mean over a tooth is
  // constant.
  TorqueRipple ripple(1e-6);
  Feed(
      &ripple, [](double t) { return 1 + std::fmod(t, 1e-6) / 1e-6; }, 1e-6, 8);
  const TorqueRipple::Figures figures = ripple.Judge();
  EXPECT_NEAR(figures.mean_Nm, 1.5, 1e-9);
  EXPECT_LT(figures.rms, 1e-9);
}

}  // namespace
}  // namespace focalfleet::sim
