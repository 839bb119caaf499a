#include "sim/world/mechanism.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/rng.h"
#include "sim/world/spread.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

UnitDescription Describe() {
  UnitDescription unit;
  unit.id = {12};
  unit.base_x_mm = 3;
  unit.base_y_mm = -4;
  unit.axis[0] = {3.1, 122.8, 337.36, -195, 195, std::nullopt};
  unit.axis[1] = {2.9, 0.7, 337.36, -5, 186.5, std::nullopt};
  return unit;
}

// The two printed lines of the file format, coordinate by coordinate.
TEST(Mechanism, PutsTheFibreWhereTheSharedFormulaDoes) {
  const std::uint64_t seed = focalfleet::test::TestSeed(5);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int i = 0; i < 1000; ++i) {
    UnitDescription unit = Describe();
    unit.base_x_mm = rng.Uniform(-400, 400);
    unit.base_y_mm = rng.Uniform(-400, 400);
    for (AxisDescription& axis : unit.axis) {
      axis.arm_mm = rng.Uniform(1, 20);
      axis.zero_deg = rng.Uniform(-180, 180);
    }
    const double theta = rng.Uniform(-400, 400);
    const double phi = rng.Uniform(-200, 200);
    const double rad = M_PI / 180;
    const double upper = (theta + unit.axis[0].zero_deg) * rad;
    const double lower = upper + (phi + unit.axis[1].zero_deg) * rad;
    const auto fibre = FibreAt(BuiltAsDescribed(unit), {theta, phi});
    EXPECT_NEAR(fibre.real(),
                unit.base_x_mm + unit.axis[0].arm_mm * std::cos(upper) +
                    unit.axis[1].arm_mm * std::cos(lower),
                1e-9);
    EXPECT_NEAR(fibre.imag(),
                unit.base_y_mm + unit.axis[0].arm_mm * std::sin(upper) +
                    unit.axis[1].arm_mm * std::sin(lower),
                1e-9);
  }
}

TEST(Spread, NominalUnitsAreBuiltAsDescribed) {
  const UnitTraits traits = DrawTraits(Describe(), {.seed = 9, .clock_error_max = 0.001});
  EXPECT_EQ(traits.mechanism.arm_mm[0], 3.1);
  EXPECT_EQ(traits.axis[0].gear, 337.36);
  EXPECT_EQ(traits.axis[0].backlash_deg, 0);
  EXPECT_EQ(traits.axis[0].scatter_deg, 0);
  EXPECT_EQ(traits.axis[0].grip, 1);
  EXPECT_NE(traits.clock.rate, 1);
  EXPECT_NEAR(traits.clock.rate, 1, 0.001);
}

TEST(Spread, RealUnitsSpreadAsMeasured) {
  constexpr int kUnits = 5000;
  int bad = 0;
  int off_scale = 0;
  double arm_squares = 0;
  double scale_squares = 0;
  int scaled = 0;
  for (std::uint32_t i = 0; i < kUnits; ++i) {
    UnitDescription unit = Describe();
    unit.id = {i};
    const UnitTraits traits = DrawTraits(unit, {.seed = 9, .spread = Spread::kReal});
    bool off = false;
    for (std::size_t axis = 0; axis < kAxisCount; ++axis) {
      const AxisTraits& a = traits.axis[axis];
      EXPECT_GE(a.backlash_deg, 1.4);
      EXPECT_LE(a.backlash_deg, 1.6);
      EXPECT_GE(a.scatter_deg, 0.09);
      EXPECT_LE(a.scatter_deg, 0.14);
      const double scale = a.gear / 337.36 - 1;
      if (std::abs(scale) > 0.0125) {
        off = true;
      } else {
        scale_squares += scale * scale;
        ++scaled;
      }
      bad += a.grip < 1 ? 1 : 0;
      const double arm = traits.mechanism.arm_mm[axis] - unit.axis[axis].arm_mm;
      arm_squares += arm * arm;
    }
    off_scale += off ? 1 : 0;
  }
  EXPECT_GT(bad, kUnits * 0.02);
  EXPECT_LT(bad, kUnits * 0.06);
  EXPECT_GT(off_scale, kUnits * 0.07);
  EXPECT_LT(off_scale, kUnits * 0.10);
  EXPECT_NEAR(std::sqrt(arm_squares / (2 * kUnits)), 0.057, 0.003);
  EXPECT_NEAR(std::sqrt(scale_squares / scaled), 0.003, 0.0002);
}

TEST(Spread, AUnitKeepsItsCharacterWhateverElseIsThere) {
  const UnitTraits once = DrawTraits(Describe(), {.seed = 9, .spread = Spread::kReal});
  const UnitTraits again = DrawTraits(Describe(), {.seed = 9, .spread = Spread::kReal});
  const UnitTraits other = DrawTraits(Describe(), {.seed = 10, .spread = Spread::kReal});
  EXPECT_EQ(once.axis[0].gear, again.axis[0].gear);
  EXPECT_EQ(once.axis[1].backlash_deg, again.axis[1].backlash_deg);
  EXPECT_NE(once.axis[0].gear, other.axis[0].gear);
}

TEST(Spread, FirstPosesAreFolded) {
  UnitDescription unit = Describe();
  EXPECT_DOUBLE_EQ(FirstPoseDeg(unit, 1)[0], 0);
  EXPECT_DOUBLE_EQ(FirstPoseDeg(unit, 1)[1], 179.3);
  unit.axis[1].max_deg = 150;
  EXPECT_DOUBLE_EQ(FirstPoseDeg(unit, 1)[1], 150);
  unit.axis[1].max_deg = 186.5;
  unit.enabled = false;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const auto pose = FirstPoseDeg(unit, seed);
    EXPECT_GE(pose[1] + unit.axis[1].zero_deg, 120);
    EXPECT_LE(pose[1], 186.5);
    EXPECT_GE(pose[0], -195);
    EXPECT_LE(pose[0], 195);
  }
  unit.axis[0].angle_deg = 17;
  EXPECT_EQ(FirstPoseDeg(unit, 1)[0], 17);
}

}  // namespace
}  // namespace focalfleet::sim
