// A camera finds units of unknown place, but for those whose arm is folded. A folded arm of a unit
// of known place stays as it is believed.
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/camera/findings.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/layout.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

constexpr double kSigmaMm = 0.002;

class LostPose : public ::testing::Test {
 protected:
  /// The pose that is found where the unit truly stands at these angles.
  std::optional<Pose> Found(double theta_deg, double phi_deg) const {
    const Pose truth{NearestVectors(theta_deg, unit_.axis[0], drive_.axis[0]),
                     NearestVectors(phi_deg, unit_.axis[1], drive_.axis[1])};
    UnitExpectation expectation;
    expectation.commanded = AnglesOf(unit_, drive_, truth);  // whole turn and side are not asked
    return PoseOfLost(unit_, drive_, FibreAt(unit_, drive_, truth), expectation, kSigmaMm,
                      layout_.clearance_mm());
  }

  const Layout layout_ = *Layout::Create(MakeHexLayout({.count = 7}), {});
  const Unit& unit_ = layout_.units()[0];
  const UnitDrive drive_{};
};

TEST_F(LostPose, OfAnOpenArmIsFound) {
  for (const double phi_deg : {30.0, 90.0, 150.0, 177.0})
    EXPECT_TRUE(Found(40, phi_deg)) << phi_deg;
}

TEST_F(LostPose, OfAFoldedArmIsNotKnownForItPointsAnywhere) {
  const double arm_mm = unit_.phi().arm_mm;
  const double least_mm = 4 * kSigmaMm * unit_.theta().arm_mm / layout_.clearance_mm();
  const double folded_deg = 180 - 2 * std::asin(least_mm / 2 / arm_mm) * 180 / std::acos(-1.0);
  EXPECT_TRUE(Found(40, folded_deg - 0.2));
  EXPECT_FALSE(Found(40, folded_deg + 0.2));
  EXPECT_FALSE(Found(40, 180));
}

// With short arms and little clearance the elbow of a stretched arm is not known well enough.
TEST(LostPoseOfASmallUnit, WithItsArmStretchedIsNotKnown) {
  const Layout layout = *Layout::Create(MakeHexLayout({.count = 7, .pitch_mm = 6.2}), {});
  const Unit& unit = layout.units()[0];
  const UnitDrive drive{};
  const auto found = [&](double phi_deg) {
    const Pose truth{NearestVectors(40, unit.axis[0], drive.axis[0]),
                     NearestVectors(phi_deg, unit.axis[1], drive.axis[1])};
    UnitExpectation expectation;
    expectation.commanded = AnglesOf(unit, drive, truth);
    return PoseOfLost(unit, drive, FibreAt(unit, drive, truth), expectation, kSigmaMm,
                      layout.clearance_mm());
  };
  EXPECT_TRUE(found(60));
  EXPECT_FALSE(found(0.5));
}

// A unit of known place that rests with its arm folded is seen again and again.
TEST(KnownPose, OfAFoldedArmDoesNotWanderWithTheNoiseOfSpots) {
  constexpr double kSpotMm = 0.005, kFromBaseMm = 0.14;
  constexpr int kExposures = 200;
  const std::uint64_t seed = test::TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "spots");
  const Layout layout = *Layout::Create(MakeHexLayout({.count = 7}), {});
  const Unit& unit = layout.units()[0];
  const UnitDrive drive{};
  const double folded_deg =
      180 - 2 * std::asin(kFromBaseMm / 2 / unit.phi().arm_mm) * 180 / std::acos(-1.0);
  for (const bool was_seen : {false, true}) {
    const Pose truth{NearestVectors(40, unit.axis[0], drive.axis[0]),
                     NearestVectors(folded_deg, unit.axis[1], drive.axis[1])};
    const PointFp elbow = ArmAt(unit, AnglesOf(unit, drive, truth)).a;
    const PointFp fibre = FibreAt(unit, drive, truth);
    Pose believed = truth;
    for (int k = 0; k < kExposures; ++k) {
      const PointFp seen{fibre.x_mm + rng.Normal() * kSpotMm, fibre.y_mm + rng.Normal() * kSpotMm};
      const auto pose = PoseOfKnown(
          unit, drive, seen, believed,
          {.sigma_mm = kSpotMm, .clearance_mm = layout.clearance_mm(), .was_seen = was_seen});
      ASSERT_TRUE(pose);
      believed = *pose;
      const PointFp at = ArmAt(unit, AnglesOf(unit, drive, believed)).a;
      EXPECT_LT(std::hypot(at.x_mm - elbow.x_mm, at.y_mm - elbow.y_mm), layout.clearance_mm())
          << "exposure " << k;
    }
  }
}

// An open arm's pose is that of the spot, though the belief was off by four standard deviations.
TEST(KnownPose, OfAnOpenArmIsThatOfTheSpot) {
  const Layout layout = *Layout::Create(MakeHexLayout({.count = 7}), {});
  const Unit& unit = layout.units()[0];
  const UnitDrive drive{};
  const Pose truth{NearestVectors(40, unit.axis[0], drive.axis[0]),
                   NearestVectors(100, unit.axis[1], drive.axis[1])};
  const Pose believed{NearestVectors(38.5, unit.axis[0], drive.axis[0]),
                      NearestVectors(101.5, unit.axis[1], drive.axis[1])};
  const PointFp fibre = FibreAt(unit, drive, truth);
  const auto pose =
      PoseOfKnown(unit, drive, fibre, believed,
                  {.sigma_mm = 0.005, .clearance_mm = layout.clearance_mm(), .was_seen = true});
  ASSERT_TRUE(pose);
  const PointFp at = FibreAt(unit, drive, *pose);
  EXPECT_LT(std::hypot(at.x_mm - fibre.x_mm, at.y_mm - fibre.y_mm), 0.002);
}

}  // namespace
}  // namespace focalfleet
