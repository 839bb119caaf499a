// Sines by the library's own series are compared with the machine's.
#include "sim/campaigns/effects/wave.h"

#include <gtest/gtest.h>

namespace focalfleet::sim {
namespace {

TEST(Wave, IsASineAndACosine) {
  for (double turns = -3; turns <= 3; turns += 0.000917) {
    const double angle = 2 * std::numbers::pi * turns;
    EXPECT_NEAR(SineOfTurns(turns), std::sin(angle), 4e-15);  // the angle itself is rounded
    EXPECT_NEAR(CosineOfTurns(turns), std::cos(angle), 4e-15);
  }
  for (double turns = -0.5; turns <= 0.5; turns += 0.0000917) {
    const long double angle = 2 * std::numbers::pi_v<long double> * static_cast<long double>(turns);
    EXPECT_NEAR(SineOfTurns(turns), static_cast<double>(std::sin(angle)), 4e-16);
  }
}

TEST(Wave, WholeTurnsLeaveNoRounding) {
  for (double deg = -2e6; deg <= 2e6; deg += 1237.3)
    EXPECT_EQ(WithoutTurns(deg), std::remainder(deg, 360.0)) << deg;
}

}  // namespace
}  // namespace focalfleet::sim
