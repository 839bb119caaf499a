#include "fleet/place_inverse.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"

namespace focalfleet {
namespace {

Unit SomeUnit() { return MakeHexLayout({.count = 1}).front(); }

WantedPlace Wanted(const Unit& unit, const PointFp& place, const AxisAngles& guess) {
  return {.fibre_fp = place,
          .guess = guess,
          .base_fp = unit.base_fp,
          .arm_mm = {unit.axis[0].arm_mm, unit.axis[1].arm_mm}};
}

TEST(PlaceInverse, FindsTheCountOfAModelThatBendsWhatIsCounted) {
  const Unit unit = SomeUnit();
  const PlaceModel bent = [&](const AxisAngles& count) {
    const double radians = count.theta_deg * std::numbers::pi / 180;
    return ArmAt(
        unit, AxisAngles{count.theta_deg + 2 + 0.5 * std::sin(radians), count.phi_deg * 1.01 - 1});
  };
  Rng rng(7);
  for (int n = 0; n < 200; ++n) {
    const AxisAngles guess{360 * rng.Uniform() - 180, 20 + 140 * rng.Uniform()};
    const PointFp place = FibreAt(unit, guess);
    const auto count = CountAt(Wanted(unit, place, guess), bent);
    ASSERT_TRUE(count) << n;
    EXPECT_LT(DistanceMm(bent(*count).b, place), 5e-4) << n;
  }
}

TEST(PlaceInverse, KeepsTheGuessWhereTheModelIsThereAlready) {
  const Unit unit = SomeUnit();
  const AxisAngles guess{30, 90};
  int calls = 0;
  const auto count = CountAt(Wanted(unit, FibreAt(unit, guess), guess), [&](const AxisAngles& at) {
    ++calls;
    return ArmAt(unit, at);
  });
  ASSERT_TRUE(count);
  EXPECT_EQ(count->theta_deg, guess.theta_deg);
  EXPECT_EQ(count->phi_deg, guess.phi_deg);
  EXPECT_EQ(calls, 1);
}

TEST(PlaceInverse, IsNoFartherOffThanTheGuessWhereThePlaceIsOutOfReach) {
  const Unit unit = SomeUnit();
  const double reach_mm = unit.axis[0].arm_mm + unit.axis[1].arm_mm;
  const PointFp beyond{unit.base_fp.x_mm + reach_mm + 0.1, unit.base_fp.y_mm};
  const AxisAngles guess{-unit.axis[0].zero_deg, 20};
  int calls = 0;
  const auto count = CountAt(Wanted(unit, beyond, guess), [&](const AxisAngles& at) {
    ++calls;
    return ArmAt(unit, at);
  });
  ASSERT_TRUE(count);
  EXPECT_LE(DistanceMm(FibreAt(unit, *count), beyond), DistanceMm(FibreAt(unit, guess), beyond));
  EXPECT_LE(calls, 12);
}

TEST(PlaceInverse, GivesNothingFartherThanThirtyDegreesFromTheGuess) {
  const Unit unit = SomeUnit();
  const PointFp place = FibreAt(unit, AxisAngles{70, 90});
  const PlaceModel exact = [&](const AxisAngles& at) { return ArmAt(unit, at); };
  EXPECT_FALSE(CountAt(Wanted(unit, place, {35, 90}), exact));
  EXPECT_TRUE(CountAt(Wanted(unit, place, {45, 90}), exact));
}

TEST(PlaceInverse, GivesNothingWhereTheModelIsNotFinite) {
  const Unit unit = SomeUnit();
  EXPECT_FALSE(CountAt(Wanted(unit, {}, {10, 90}), [](const AxisAngles&) {
    return SegmentFp{{}, {NAN, 0}};
  }));
}

}  // namespace
}  // namespace focalfleet
