#include "fleet/coordinate/unidirectional_approach.h"

#include <gtest/gtest.h>

#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::FleetOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::UnitAt;

struct OneUnit {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0)});
  CoordinatorConfig config;
  UnitKnowledge knowledge = Exactly(Witness::kReported, PoseDeg(fleet, 0, 10, 40));
  std::array<AxisPlay, kAxisCount> play;
  std::optional<Correction> correction;

  [[nodiscard]] ApproachUnit unit() const {
    const Unit& unit = fleet.layout.unit({0});
    ApproachUnit approach{.unit = unit,
                          .drive = fleet.drives[0],
                          .config = config,
                          .knowledge = knowledge,
                          .play = play,
                          .correction = correction};
    for (const Axis axis : kAxes)
      approach.range[Index(axis)] =
          RangeOf(unit.axis[Index(axis)], fleet.drives[0].axis[Index(axis)]);
    return approach;
  }
  void PushDown() {
    for (AxisPlay& axis : play) axis.Go(-1);
  }
};

TEST(UnidirectionalApproach, ABlindWayGoesPastTheTargetFirstAndComesBackFromTheUsualSide) {
  const OneUnit one;
  const Pose target = PoseDeg(one.fleet, 0, 30, 60);
  const std::vector<Pose> past = PosesPast(one.unit(), target);
  ASSERT_FALSE(past.empty());
  for (const Axis axis : kAxes) {
    const std::int32_t back = target[Index(axis)] - past[0][Index(axis)];
    EXPECT_EQ(back, UsualSide(one.config, axis) * ApproachLength(one.unit(), axis));
    EXPECT_LT(back, 0) << "two degrees, downwards";
  }
}

TEST(UnidirectionalApproach, AMeasuredAxisThatGoesOnAsItCameNeedsNone) {
  OneUnit one;
  one.knowledge = Exactly(Witness::kMeasured, PoseDeg(one.fleet, 0, 10, 40));
  one.PushDown();
  EXPECT_FALSE(NeedsApproach(one.unit(), Axis::kPhi, -10));
  EXPECT_TRUE(NeedsApproach(one.unit(), Axis::kPhi, 10)) << "back";
  EXPECT_TRUE(NeedsApproach(one.unit(), Axis::kPhi, -2 * ApproachLength(one.unit(), Axis::kPhi)))
      << "far";
}

TEST(UnidirectionalApproach, ACorrectionKeepsTheSideOnWhichItWasMeasured) {
  OneUnit one;
  one.PushDown();
  one.correction = Correction{.aim = PlaceOf(one.knowledge), .side = {-1, -1}};
  EXPECT_FALSE(NeedsApproach(one.unit(), Axis::kTheta, -1));
  EXPECT_TRUE(NeedsApproach(one.unit(), Axis::kTheta, 1));
  one.correction->side = {};
  EXPECT_FALSE(NeedsApproach(one.unit(), Axis::kTheta, 1)) << "the side is not known";
}

TEST(UnidirectionalApproach, ACorrectionThatIsNotTheLastEndsShortOfTheTarget) {
  OneUnit one;
  one.PushDown();
  const Pose goal = PoseDeg(one.fleet, 0, 9.5, 39.5);
  one.correction = Correction{.aim = goal, .side = {-1, -1}};
  const Pose aim = AimOf(one.unit(), goal, /*is_last=*/false, /*tolerance_um=*/10);
  EXPECT_GT(aim[0], goal[0]);
  EXPECT_GT(aim[1], goal[1]);
  EXPECT_EQ(AimOf(one.unit(), goal, /*is_last=*/true, 10), goal) << "both go on as they came";
}

TEST(UnidirectionalApproach, AnAxisThatWouldComeFromTheWrongSideWaits) {
  OneUnit one;
  one.PushDown();
  const Pose place = PlaceOf(one.knowledge);
  one.correction = Correction{.aim = {place[0] + 1, place[1] - 1}, .side = {-1, -1}};
  EXPECT_EQ(NextPose(one.unit()), (Pose{place[0], place[1] - 1}));
}

}  // namespace
}  // namespace focalfleet
