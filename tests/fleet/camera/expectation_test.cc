#include "fleet/camera/expectation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>

#include "fleet/hex_layout.h"
#include "protocol/base/rng.h"
#include "sim/world/mechanism.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

Unit OneUnit() {
  Unit unit = MakeHexLayout({.count = 1})[0];
  unit.axis[0].zero_deg = 33;
  unit.axis[1].zero_deg = 4;
  unit.axis[1].arm_mm = 7;
  return unit;
}

TEST(CovarianceAt, IsThatOfTheSimulatorsMechanism) {
  const std::uint64_t seed = test::TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const Unit unit = OneUnit();
  const sim::Mechanism mechanism{{unit.base_fp.x_mm, unit.base_fp.y_mm}, {8.25, 7}, {33, 4}};
  const BlindError blind{0.3, 0.2, 0.01};
  const AxisAngles angles{71, 62};
  const std::complex<double> centre = sim::FibreAt(mechanism, {71, 62});
  CovarianceFp sum;
  const int draws = 20000;
  for (int k = 0; k < draws; ++k) {
    const std::complex<double> d =
        sim::FibreAt(mechanism, {71 + 0.3 * rng.Normal(), 62 + 0.2 * rng.Normal()}) - centre +
        std::complex<double>(0.01 * rng.Normal(), 0.01 * rng.Normal());
    sum.xx += d.real() * d.real() / draws;
    sum.xy += d.real() * d.imag() / draws;
    sum.yy += d.imag() * d.imag() / draws;
  }
  const CovarianceFp claimed = CovarianceAt(unit, angles, blind);
  const double scale = claimed.xx + claimed.yy;
  EXPECT_NEAR(sum.xx, claimed.xx, 0.03 * scale);
  EXPECT_NEAR(sum.xy, claimed.xy, 0.03 * scale);
  EXPECT_NEAR(sum.yy, claimed.yy, 0.03 * scale);
}

TEST(CovarianceAt, OfEqualAnglesIsRootThreeArmsTimesTheAngleOverThePatrolArea) {
  Rng rng(1);
  const Unit unit = MakeHexLayout({.count = 1})[0];
  const double sigma_deg = 0.22;
  double sum = 0;
  const int draws = 20000;
  for (int k = 0; k < draws; ++k) {
    // Evenly over the disc: r^2 = 2 a^2 (1 + cos phi).
    const double phi = std::acos(2 * rng.Uniform() - 1) * 180 / std::acos(-1.0);
    const CovarianceFp c = CovarianceAt(unit, {0, phi}, {sigma_deg, sigma_deg, 0});
    sum += (c.xx + c.yy) / draws;
  }
  // The mean of r^2 is 2 a^2, phi turns the fibre at the radius a.
  const double expected_mm = std::sqrt(3) * unit.theta().arm_mm * sigma_deg * std::acos(-1.0) / 180;
  EXPECT_NEAR(std::sqrt(sum) / expected_mm, 1, 0.01);
}

TEST(SquaredSigmas, CountsAlongTheEllipse) {
  const CovarianceFp c{4, 0, 1};
  EXPECT_NEAR(SquaredSigmas({0, 0}, {4, 0}, c, 0), 4, 1e-12);
  EXPECT_NEAR(SquaredSigmas({0, 0}, {0, 4}, c, 0), 16, 1e-12);
  EXPECT_NEAR(SquaredSigmas({0, 0}, {0, 4}, c, std::sqrt(3.0)), 4, 1e-12);
  EXPECT_NEAR(LargestVariance({2.5, 1.5, 2.5}), 4, 1e-12);
}

TEST(ReadPose, NearbyBeliefDecidesTheTurnAndTheElbow) {
  const Unit unit = MakeHexLayout({.count = 1})[0];
  const AxisAngles truth{100, 60};
  const auto reading = ReadPose(unit, FibreAt(unit, truth), {100.3, 59.8}, 5);
  ASSERT_TRUE(reading.nearest);
  EXPECT_NEAR(reading.nearest->theta_deg, 100, 1e-6);
  EXPECT_NEAR(reading.nearest->phi_deg, 60, 1e-6);
  EXPECT_TRUE(reading.elbow_is_known);
  EXPECT_TRUE(reading.turn_is_known);
}

TEST(ReadPose, WithoutABeliefTheTurnIsOpen) {
  const Unit unit = MakeHexLayout({.count = 1})[0];
  // Theta goes from -190 to 190: 175 and -185 are the same direction.
  const auto reading = ReadPose(unit, FibreAt(unit, {175, 60}), {175, 60}, 1000);
  ASSERT_TRUE(reading.nearest);
  EXPECT_FALSE(reading.turn_is_known);
  EXPECT_TRUE(reading.elbow_is_known) << "phi from 0 to 180 leaves one side";
}

TEST(ReadPose, BothSidesOfTheElbowAreOpenWherePhiGoesBothWays) {
  Unit unit = MakeHexLayout({.count = 1})[0];
  unit.axis[1].min_deg = -180;
  const PointFp place = FibreAt(unit, {20, 70});
  EXPECT_FALSE(ReadPose(unit, place, {20, 70}, 1000).elbow_is_known);
  EXPECT_TRUE(ReadPose(unit, place, {20, 70}, 10).elbow_is_known);
}

TEST(ReadPose, APlaceOutOfReachHasNoPose) {
  const Unit unit = MakeHexLayout({.count = 1})[0];
  EXPECT_FALSE(ReadPose(unit, {30, 0}, {0, 0}, 10).nearest);
}

}  // namespace
}  // namespace focalfleet
