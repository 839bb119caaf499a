// A camera finds units of unknown place, but for those whose arm is folded.
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/camera/findings.h"
#include "fleet/hex_layout.h"
#include "fleet/kinematics.h"
#include "fleet/layout.h"

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

}  // namespace
}  // namespace focalfleet
