// A thermal mass is compared with Euler's method with small steps.
#include "sim/campaigns/effects/thermal_mass.h"

#include <gtest/gtest.h>

namespace focalfleet::sim {
namespace {

TEST(ThermalMass, FollowsRampsLikeTheIntegratedEquation) {
  const std::vector<double> time_s = {0, 30, 30, 400, 420, 3000};
  const std::vector<double> around_C = {10, 12, 12, 5, 5, 20};
  constexpr double kTau_s = 200;
  const std::vector<double> late = Late(around_C, time_s, kTau_s);
  double at = around_C[0];
  for (std::size_t i = 1; i < time_s.size(); ++i) {
    constexpr int kSteps = 200'000;
    const double step = (time_s[i] - time_s[i - 1]) / kSteps;
    for (int k = 0; k < kSteps; ++k) {
      const double share = (k + 0.5) / kSteps;
      const double around = around_C[i - 1] + share * (around_C[i] - around_C[i - 1]);
      at += (around - at) / kTau_s * step;
    }
    EXPECT_NEAR(late[i], at, 1e-4) << "value " << i;
  }
}

}  // namespace
}  // namespace focalfleet::sim
