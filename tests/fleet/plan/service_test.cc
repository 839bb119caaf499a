#include "fleet/plan/service.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "fleet/plan/bounds.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::FleetOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::UnitAt;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// Three units side by side; the first two would touch at their targets, the third is far away.
class ServiceTest : public ::testing::Test {
 protected:
  ServiceTest() : fleet_(FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 80)})) {
    start_ = {PoseDeg(fleet_, 0, 90, 120), PoseDeg(fleet_, 1, -90, 120),
              PoseDeg(fleet_, 2, 10, 30)};
    fleet_.StandAt(start_);
    fleet_.targets = {PoseDeg(fleet_, 0, 0, 0), PoseDeg(fleet_, 1, 180, 0),
                      PoseDeg(fleet_, 2, 50, 31)};
    request_ = fleet_.request();
    scene_.emplace(fleet_.layout, request_.drives, request_.start, request_.offsets);
  }
  [[nodiscard]] Service Made() const { return {request_, *scene_, start_}; }

  PlanningFleet fleet_;
  std::vector<Pose> start_;
  PlanRequest request_;
  std::optional<Scene> scene_;
};

TEST_F(ServiceTest, ACopyBringsBackGoalsAndReasons) {
  Service service = Made();
  const Service before = service;
  service.Unserve(0, UnservedWhy::kBlocked, 1);
  service.Hold(0);
  EXPECT_FALSE(service.goes(0));
  EXPECT_EQ(service.goal(0), start_[0]);
  ASSERT_EQ(service.NotServed().size(), 1u);
  EXPECT_EQ(service.NotServed()[0].by, PositionerIndex{1});
  service = before;
  EXPECT_TRUE(service.goes(0));
  EXPECT_TRUE(service.is_movable(0));
  EXPECT_EQ(service.goal(0), *fleet_.targets[0]);
  EXPECT_TRUE(service.NotServed().empty());
}

TEST_F(ServiceTest, AReadmittedUnitGoesAndHasNoReasonLeft) {
  Service service = Made();
  service.Unserve(2, UnservedWhy::kBlocked, kNoUnitIndex);
  service.Unserve(0, UnservedWhy::kTargetCollides, 1);
  service.Hold(2);
  service.Readmit(2);
  EXPECT_TRUE(service.goes(2));
  EXPECT_EQ(service.goal(2), *fleet_.targets[2]);
  ASSERT_EQ(service.NotServed().size(), 1u);
  EXPECT_EQ(service.NotServed()[0].unit.value, 0u);
}

TEST_F(ServiceTest, NamesTargetsThatMeetAndDropsOneOfThem) {
  Service service = Made();
  EXPECT_THAT(service.TargetsTooNear(), HasSubstr("units 11 and 22"));
  EXPECT_EQ(service.StartsTooNear(), "");
  EXPECT_EQ(service.TargetsOutOfRange(), "");
  service.DropTargetsThatMeet();
  EXPECT_EQ(service.TargetsTooNear(), "");
  EXPECT_THAT(std::vector<bool>({service.goes(0), service.goes(1), service.goes(2)}),
              ElementsAre(false, true, true));
}

TEST_F(ServiceTest, BoundsAreThoseOfTheServed) {
  Service service = Made();
  const double all_s = TimeBoundS(service);
  service.Unserve(0, UnservedWhy::kBlocked, kNoUnitIndex);
  service.Unserve(1, UnservedWhy::kBlocked, kNoUnitIndex);
  const double far_one_s = TimeBoundS(service);
  EXPECT_GT(all_s, far_one_s);
  EXPECT_GT(far_one_s, 0);
  service.Unserve(2, UnservedWhy::kBlocked, kNoUnitIndex);
  EXPECT_EQ(TimeBoundS(service), 0);
}

TEST_F(ServiceTest, ALimitBelowOneMotorIsRefusedWithTheLeastThatWouldDo) {
  Service service = Made();
  PlanOptions options{.power = {.rail_W = 1e-6}};
  const Status refused = CheckPower(service, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  const std::string& text = refused.error().text;
  const auto at = text.find("at least ");
  ASSERT_NE(at, std::string::npos) << text;
  options.power.rail_W = 1.001 * std::stod(text.substr(at + 9)) + 1e-4;
  EXPECT_TRUE(CheckPower(service, options));
  // No unit goes: nothing is drawn.
  for (std::uint32_t unit = 0; unit < 3; ++unit)
    service.Unserve(unit, UnservedWhy::kBlocked, kNoUnitIndex);
  options.power.rail_W = 1e-6;
  EXPECT_TRUE(CheckPower(service, options));
}

}  // namespace
}  // namespace focalfleet
