#include "fleet/kinematics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

Unit LamostUnit() {
  Unit unit;
  unit.id = UnitId{1};
  unit.base_fp = {100, -50};
  unit.axis[0] = {8.25, 0, 337.0 * 45 / 17, -190, 190};
  unit.axis[1] = {8.25, 0, 337.0 * 45 / 17, 0, 180};
  return unit;
}

Unit RandomUnit(Rng& rng) {
  Unit unit;
  unit.base_fp = {rng.Uniform(-400, 400), rng.Uniform(-400, 400)};
  unit.axis[0] = {rng.Uniform(2, 9), rng.Uniform(-180, 180), 337.36, rng.Uniform(-400, -100),
                  rng.Uniform(100, 400)};
  unit.axis[1] = {rng.Uniform(2, 9), rng.Uniform(-30, 50), 337.36, rng.Uniform(-200, 20),
                  rng.Uniform(120, 260)};
  return unit;
}

TEST(Kinematics, FollowsTheSharedFormula) {
  Unit unit = LamostUnit();
  unit.axis[0].zero_deg = 10;
  unit.axis[1].zero_deg = -20;
  // theta 20 + 10 = 30 degrees, phi 80 - 20 = 60: the arm points straight up.
  const SegmentFp arm = ArmAt(unit, AxisAngles{20, 80});
  EXPECT_NEAR(arm.a.x_mm, 100 + 8.25 * std::sqrt(3) / 2, 1e-12);
  EXPECT_NEAR(arm.a.y_mm, -50 + 8.25 / 2, 1e-12);
  EXPECT_NEAR(arm.b.x_mm, arm.a.x_mm, 1e-12);
  EXPECT_NEAR(arm.b.y_mm, arm.a.y_mm + 8.25, 1e-12);
}

TEST(Kinematics, StretchedAndFoldedAreTheEndsOfPatrol) {
  const Unit unit = LamostUnit();
  EXPECT_NEAR(PatrolOf(unit).max_mm, 16.5, 1e-12);
  EXPECT_NEAR(PatrolOf(unit).min_mm, 0, 1e-6);
  EXPECT_NEAR(DistanceMm(FibreAt(unit, AxisAngles{77, 0}), unit.base_fp), 16.5, 1e-12);
  EXPECT_NEAR(DistanceMm(FibreAt(unit, AxisAngles{77, 180}), unit.base_fp), 0, 1e-12);
}

TEST(Kinematics, PatrolHasAHoleWhereTheArmCannotFold) {
  Unit unit = LamostUnit();
  unit.axis[1].min_deg = 10;
  unit.axis[1].max_deg = 150;
  const PatrolLimits patrol = PatrolOf(unit);
  EXPECT_NEAR(patrol.min_mm, 2 * 8.25 * std::cos(75 * 3.14159265358979 / 180), 1e-9);
  EXPECT_NEAR(patrol.max_mm, 2 * 8.25 * std::cos(5 * 3.14159265358979 / 180), 1e-9);
  EXPECT_TRUE(AnglesFor(unit, {100 + patrol.min_mm - 0.01, -50}).empty());
  EXPECT_FALSE(AnglesFor(unit, {100 + patrol.min_mm + 0.01, -50}).empty());
  EXPECT_FALSE(AnglesFor(unit, {100 + patrol.max_mm - 0.01, -50}).empty());
  EXPECT_TRUE(AnglesFor(unit, {100 + patrol.max_mm + 0.01, -50}).empty());
}

TEST(Kinematics, EverySolutionOfAReachablePointIsFoundAndReachesIt) {
  const std::uint64_t seed = test::TestSeed(20240611);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 20'000; ++k) {
    const Unit unit = RandomUnit(rng);
    const AxisAngles angles{rng.Uniform(unit.theta().min_deg, unit.theta().max_deg),
                            rng.Uniform(unit.phi().min_deg, unit.phi().max_deg)};
    const PointFp fibre = FibreAt(unit, angles);
    const auto solutions = AnglesFor(unit, fibre, angles.theta_deg);
    bool found = false;
    for (const AxisAngles& s : solutions) {
      EXPECT_LE(DistanceMm(FibreAt(unit, s), fibre), kReachToleranceMm);
      EXPECT_GE(s.theta_deg, unit.theta().min_deg);
      EXPECT_LE(s.theta_deg, unit.theta().max_deg);
      EXPECT_GE(s.phi_deg, unit.phi().min_deg);
      EXPECT_LE(s.phi_deg, unit.phi().max_deg);
      // Near stretched and folded the point hardly fixes phi, hence the distance of the elbows.
      found |= DistanceMm(ArmAt(unit, s).a, ArmAt(unit, angles).a) < 1e-3 &&
               std::abs(s.theta_deg - angles.theta_deg) < 90;
    }
    EXPECT_TRUE(found) << "theta " << angles.theta_deg << " phi " << angles.phi_deg;
    const PatrolLimits patrol = PatrolOf(unit);
    EXPECT_LE(DistanceMm(fibre, unit.base_fp), patrol.max_mm + 1e-9);
    EXPECT_GE(DistanceMm(fibre, unit.base_fp), patrol.min_mm - 1e-9);
  }
}

TEST(Kinematics, BothElbowSidesAndWholeTurnsCount) {
  Unit unit = LamostUnit();
  unit.axis[1].min_deg = -180;
  const auto at = [&](double theta, double phi) { return FibreAt(unit, AxisAngles{theta, phi}); };
  EXPECT_EQ(AnglesFor(unit, at(0, 90)).size(), 2u);    // phi 90 and -90; theta 0 and 90
  EXPECT_EQ(AnglesFor(unit, at(175, 90)).size(), 3u);  // theta 175 and -185, elbow right: -95
  unit.axis[1].min_deg = 0;
  EXPECT_EQ(AnglesFor(unit, at(0, 90)).size(), 1u);
  EXPECT_EQ(AnglesFor(unit, at(-185, 90)).size(), 2u);
}

TEST(Kinematics, OverTheBaseAnyThetaServes) {
  const Unit unit = LamostUnit();
  const auto solutions = AnglesFor(unit, unit.base_fp, 33);
  ASSERT_FALSE(solutions.empty());
  EXPECT_EQ(solutions[0].theta_deg, 33);
  EXPECT_NEAR(solutions[0].phi_deg, 180, 0.01);
}

TEST(Kinematics, ARoundedPointOnTheBorderIsReached) {
  const Unit unit = LamostUnit();
  EXPECT_FALSE(AnglesFor(unit, {100 + 16.5004, -50}).empty());
  EXPECT_TRUE(AnglesFor(unit, {100 + 16.502, -50}).empty());
}

TEST(Kinematics, NoPointOfNaN) {
  EXPECT_TRUE(AnglesFor(LamostUnit(), {std::nan(""), 0}).empty());
  EXPECT_TRUE(AnglesFor(LamostUnit(), {std::numeric_limits<double>::infinity(), 0}).empty());
}

TEST(Kinematics, WholeVectorsStayWithinTheRange) {
  const AxisDrive drive;
  AxisGeometry axis{8.25, 0, 337.0 * 45 / 17, -190, 190};
  const VectorRange range = RangeOf(axis, drive);
  EXPECT_LE(AngleDeg(range.high, axis, drive), 190 + 1e-9);
  EXPECT_GT(AngleDeg(range.high + 1, axis, drive), 190);
  EXPECT_GE(AngleDeg(range.low, axis, drive), -190 - 1e-9);
  EXPECT_EQ(NearestInRange(1e6, axis, drive), range.high);
  EXPECT_EQ(NearestInRange(-1e6, axis, drive), range.low);
  EXPECT_EQ(NearestInRange(12.3, axis, drive), NearestVectors(12.3, axis, drive));
  axis.max_deg = 1000 * DegreesPerVector(axis, drive);  // exactly a whole vector
  EXPECT_EQ(RangeOf(axis, drive).high, 1000);
}

TEST(Kinematics, TurnsStayInRange) {
  const AxisGeometry axis{1, 0, 300, -400, 400};
  EXPECT_EQ(TurnsInRange(0, axis), (std::vector<double>{-360, 0, 360}));
  EXPECT_EQ(TurnsInRange(3600 + 50, axis), (std::vector<double>{-310, 50}));
  EXPECT_TRUE(TurnsInRange(90, {1, 0, 300, -45, 45}).empty());
  for (const double beyond : {1e15, 1e17, -1e300, std::numeric_limits<double>::infinity()})
    EXPECT_LE(TurnsInRange(beyond, axis).size(), 3u) << beyond;
}

}  // namespace
}  // namespace focalfleet
