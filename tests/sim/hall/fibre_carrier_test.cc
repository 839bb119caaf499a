// The tip of a ball-jointed fibre carrier at an orientation, and the readings of its joint's
// sensors.
#include "sim/hall/fibre_carrier.h"

#include <gtest/gtest.h>

#include "protocol/wire/messages.h"
#include "sim/hall/field_fit.h"
#include "tests/support/seed.h"

namespace focalfleet::sim {
namespace {

using test::TestSeed;
using Covariance = std::array<std::array<double, 3>, 3>;

constexpr double kLength_mm = 33;

// The fibre carrier is the rotor's z axis: the direction that R^T takes to (0, 0, 1).
TEST(FibreCarrier, TheTipIsWhereTheRotorsAxisPoints) {
  const auto seed = TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 1000; ++k) {
    const Orientation at{rng.Uniform(-0.7, 0.7), rng.Uniform(-0.7, 0.7), rng.Uniform(-0.7, 0.7)};
    const TipEstimate tip = TipOf(at, {}, kLength_mm);
    const double x = tip.x_mm / kLength_mm, y = tip.y_mm / kLength_mm;
    const Vector3 axis = Rotation(at).ToRotor({x, y, std::sqrt(1 - x * x - y * y)});
    EXPECT_NEAR(axis.x, 0, 1e-12);
    EXPECT_NEAR(axis.y, 0, 1e-12);
    EXPECT_NEAR(axis.z, 1, 1e-12);
    const Orientation back = TiltOf({tip.x_mm, tip.y_mm, kLength_mm});
    EXPECT_NEAR(back.alpha_rad, at.alpha_rad, 1e-12);
    EXPECT_NEAR(back.beta_rad, at.beta_rad, 1e-12);
  }
}

// The tips of drawn orientations scatter as the covariance says.
TEST(FibreCarrier, TheTipsCovarianceIsThatOfDrawnOrientations) {
  const auto seed = TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const Orientation at{0.5, -0.4, 0.1};
  // L L^T of a lower triangle gives correlated angles.
  const double a = 1e-4, b = 6e-5, c = 1.2e-4;
  Covariance covariance{};
  covariance[0] = {a * a, a * b, 0};
  covariance[1] = {a * b, b * b + c * c, 0};
  const TipEstimate reported = TipOf(at, covariance, kLength_mm);
  double xx = 0, xy = 0, yy = 0;
  constexpr int kDraws = 200'000;
  for (int k = 0; k < kDraws; ++k) {
    const double one = rng.Normal(), two = rng.Normal();
    const TipEstimate tip = TipOf(
        {at.alpha_rad + a * one, at.beta_rad + b * one + c * two, at.gamma_rad}, {}, kLength_mm);
    xx += (tip.x_mm - reported.x_mm) * (tip.x_mm - reported.x_mm) / kDraws;
    xy += (tip.x_mm - reported.x_mm) * (tip.y_mm - reported.y_mm) / kDraws;
    yy += (tip.y_mm - reported.y_mm) * (tip.y_mm - reported.y_mm) / kDraws;
  }
  const double scale = reported.var_x_mm2 + reported.var_y_mm2;
  EXPECT_NEAR(xx, reported.var_x_mm2, 0.02 * scale);
  EXPECT_NEAR(xy, reported.cov_xy_mm2, 0.02 * scale);
  EXPECT_NEAR(yy, reported.var_y_mm2, 0.02 * scale);
}

class FibreCarrierReading : public ::testing::Test {
 protected:
  static FieldMap Map(const FibreCarrierJoints& joints) {
    FieldMap map;
    for (int theta = 0; theta <= 180; theta += 4)
      for (int phi = 0; phi < 360; phi += 4)
        map.push_back({theta * kRadPerDeg, phi * kRadPerDeg,
                       joints.Field_T(theta * kRadPerDeg, phi * kRadPerDeg)});
    return map;
  }
};

// From counts back to the tip: a model is fitted to the magnets' map, and the readings have noise.
// The errors are those that the covariance says.
TEST_F(FibreCarrierReading, GivesTheTipWithinItsCovariance) {
  const auto seed = TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const FibreCarrierMake make{.seed = seed};
  const FibreCarrierJoints joints(make);
  const auto fit = FitField(Map(joints), FieldKind::kSpherical);
  ASSERT_TRUE(fit) << fit.error().text;
  const OrientationSolver solver(FibreCarrierRig(8), MakeField(fit->parameters));
  double normalised = 0, worst_sigma_um = 0;
  constexpr int kReadings = 200;
  for (std::uint32_t k = 0; k < kReadings; ++k) {
    const double radius_mm = 16.5 * std::sqrt(rng.Uniform(0, 1));
    const double turn = rng.Uniform(0, 2 * std::numbers::pi);
    const FibreCarrierTip tip{radius_mm * std::cos(turn), radius_mm * std::sin(turn), kLength_mm};
    std::array<std::uint16_t, 8> counts{};
    joints.Read({k}, 0, tip, counts);
    const HallReading reading =
        ReadingOf(solver.rig(), VoltagesOf(counts, solver.rig().electronics));
    ASSERT_EQ(reading.used, 0xffu) << "a sensor saturates at " << tip.x_mm << ", " << tip.y_mm;
    const OrientationFit found = solver.Refine(reading, TiltOf(tip));
    ASSERT_TRUE(found.converged);
    Covariance covariance = found.unit_covariance;
    for (auto& row : covariance)
      for (double& entry : row) entry *= make.noise_T * make.noise_T;
    const TipEstimate reported = TipOf(found.orientation, covariance, kLength_mm);
    const double dx = reported.x_mm - tip.x_mm, dy = reported.y_mm - tip.y_mm;
    const double det =
        reported.var_x_mm2 * reported.var_y_mm2 - reported.cov_xy_mm2 * reported.cov_xy_mm2;
    normalised += (reported.var_y_mm2 * dx * dx - 2 * reported.cov_xy_mm2 * dx * dy +
                   reported.var_x_mm2 * dy * dy) /
                  det;
    worst_sigma_um =
        std::max(worst_sigma_um, 1e3 * std::sqrt((reported.var_x_mm2 + reported.var_y_mm2) / 2));
  }
  // chi^2 of two numbers each is 2 +- 2 / sqrt(readings); the model's own error adds a little.
  EXPECT_GT(normalised / kReadings, 2 - 5 * 2 / std::sqrt(kReadings));
  EXPECT_LT(normalised / kReadings, 2 + 10 * 2 / std::sqrt(kReadings));
  EXPECT_LT(worst_sigma_um, 5);
  std::printf("worst sigma %.2f um, mean chi^2 %.2f of 2\n", worst_sigma_um,
              normalised / kReadings);
}

TEST_F(FibreCarrierReading, IsTheSameAgainAndAnotherTheNextTime) {
  const FibreCarrierJoints joints({.seed = 4});
  const FibreCarrierTip tip{5, -3, kLength_mm};
  std::array<std::uint16_t, 8> one{}, again{}, next{}, other{};
  joints.Read({7}, 0, tip, one);
  joints.Read({7}, 0, tip, again);
  joints.Read({7}, 1, tip, next);
  joints.Read({8}, 0, tip, other);
  EXPECT_EQ(one, again);
  EXPECT_NE(one, next);
  EXPECT_NE(one, other);
}

TEST_F(FibreCarrierReading, OfSensorsThatNobodyKnowsIsNone) {
  const FibreCarrierJoints joints({});
  std::array<std::uint16_t, 7> counts{};
  joints.Read({1}, 0, {0, 0, kLength_mm}, counts);
  for (const std::uint16_t count : counts) EXPECT_EQ(count, kNoCount);
}

}  // namespace
}  // namespace focalfleet::sim
