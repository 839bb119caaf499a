// Refusals of the replanner, and the units that they name.
#include <gtest/gtest.h>

#include <cmath>

#include "fleet/geometry/arm.h"
#include "fleet/plan/replan.h"
#include "tests/fleet/plan/under_way.h"

namespace focalfleet {
namespace {

using test::Begun;
using test::DrawStartAndTargets;
using test::FleetOf;
using test::PlanningFleet;
using test::UnderWay;

class ReplanErrors : public ::testing::Test {
 protected:
  void SetUp() override {
    fleet_ = Begun(61, 770);
    ASSERT_TRUE(fleet_);
    // A unit in the middle, which has arrived.
    question_ = {.unit = {30},
                 .from = fleet_->EndPose(30),
                 .to = fleet_->EndPose(30),
                 .now_s = fleet_->plan().makespan_s + 1,
                 .start_s = fleet_->plan().makespan_s + 2};
  }
  void Expect(ErrorCode code, const std::string& words) {
    const auto late = fleet_->running().Replan(question_, deviations_);
    ASSERT_FALSE(late);
    EXPECT_EQ(late.error().code, code);
    EXPECT_NE(late.error().text.find(words), std::string::npos) << late.error().text;
  }
  [[nodiscard]] std::string IdOf(std::uint32_t i) const {
    return std::to_string(fleet_->fleet().layout.unit({i}).id.value);
  }
  /// The unit's pose that is nearest to a neighbour's arm, over all of the unit's directions.
  Pose PoseAgainst(std::uint32_t j) {
    const ArmGeometry mine(fleet_->fleet().layout.unit({30}), fleet_->fleet().drives[30]);
    const ArmGeometry theirs(fleet_->fleet().layout.unit({j}), fleet_->fleet().drives[j]);
    Pose nearest{};
    double least_mm = 1e9;
    for (std::int32_t theta = mine.range().low[0]; theta < mine.range().high[0]; theta += 500) {
      for (std::int32_t phi = mine.range().low[1]; phi < mine.range().high[1]; phi += 500) {
        const double d = DistanceMm(mine.At({theta, phi}), theirs.At(fleet_->EndPose(j)));
        if (d < least_mm) {
          least_mm = d;
          nearest = {theta, phi};
        }
      }
    }
    return nearest;
  }

  std::optional<UnderWay> fleet_;
  ReplanQuestion question_;
  std::vector<Deviation> deviations_;
};

TEST_F(ReplanErrors, NamesTheUnitThatTheTargetTouches) {
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    question_.to = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;  // out of its reach
    Expect(ErrorCode::kInvalid, "the target of unit " + IdOf(30) + " and the place where unit " +
                                    IdOf(j.value) + " ends are ");
    return;
  }
  FAIL() << "no neighbour can be touched";
}

TEST_F(ReplanErrors, RefusesWhatMakesNoSense) {
  const ReplanQuestion good = question_;
  question_.to[0] = 1 << 30;
  Expect(ErrorCode::kInvalid, "outside its axes' ranges");
  question_ = good;
  question_.start_s = question_.now_s - 1;
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.start_s = std::nan("");
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.now_s = std::nan("");
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.start_s = 1e9;
  Expect(ErrorCode::kInvalid, "cannot start then");
  question_ = good;
  question_.unit = {1000};
  Expect(ErrorCode::kInvalid, "no such unit");
}

TEST_F(ReplanErrors, NamesTheUnitInTheWay) {
  // The unit stands where a neighbour's arm is: every way begins against that arm.
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    question_.from = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;
    Expect(ErrorCode::kRefused,
           "no way to the target of unit " + IdOf(30) + " was found: unit " + IdOf(j.value));
    return;
  }
  FAIL() << "no neighbour can be touched";
}

TEST_F(ReplanErrors, StaysOutOfWhereAnotherMayBe) {
  // A neighbour may be anywhere: no place in its reach can be a target.
  int invalid = 0;
  for (const PositionerIndex j : fleet_->fleet().layout.neighbours({30})) {
    deviations_ = {{j, UnitKnowledge{}, std::nullopt}};
    question_.to = PoseAgainst(j.value);
    const auto late = fleet_->running().Replan(question_, deviations_);
    if (late) continue;
    EXPECT_EQ(late.error().code, ErrorCode::kInvalid);
    EXPECT_NE(late.error().text.find("where unit " + IdOf(j.value) + " may stand"),
              std::string::npos)
        << late.error().text;
    ++invalid;
  }
  EXPECT_GT(invalid, 0);
}

TEST_F(ReplanErrors, ADisabledUnitStays) {
  std::vector<Unit> units = MakeHexLayout({.count = 7});
  units[3].enabled = false;
  PlanningFleet fleet = FleetOf(units);
  DrawStartAndTargets(&fleet, 1);
  const RunningPlan running(fleet.request(), {}, {});
  const auto late = running.Replan(
      {.unit = {3}, .from = PlaceOf(fleet.start[3]), .to = PlaceOf(fleet.start[3]), .start_s = 1},
      {});
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kRefused);
}

}  // namespace
}  // namespace focalfleet
