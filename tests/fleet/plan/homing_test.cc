#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "fleet/plan/planner.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::CheckedRow;
using test::CheckOptions;
using test::DrawStartAndTargets;
using test::FleetOf;
using test::HexFleet;
using test::PlanningFleet;
using test::PoseDeg;
using test::Seed;
using test::UnitAt;
using ::testing::HasSubstr;

TEST(MakeWayForHoming, SendsNeighboursOutOfTheArmsWay) {
  PlanningFleet fleet = HexFleet(19);
  int made_way = 0;
  for (std::uint64_t k = 0; k < 12; ++k) {
    FOCALFLEET_TRACE_SEED(Seed(k));
    DrawStartAndTargets(&fleet, Seed(k));
    fleet.targets.assign(fleet.targets.size(), std::nullopt);
    const Pose somewhere = PlaceOf(fleet.start[0]);
    const std::int32_t spread = PoseDeg(fleet, 0, 3, 0)[0];
    for (std::size_t axis = 0; axis < kAxisCount; ++axis)
      fleet.start[0][axis] = {Witness::kInterval, somewhere[axis] - spread,
                              somewhere[axis] + spread};
    const auto targets = MakeWayForHoming(fleet.request(), {0});
    ASSERT_TRUE(targets) << targets.error().text;
    ASSERT_EQ(targets->size(), fleet.layout.size());
    EXPECT_FALSE((*targets)[0]);
    // The homing arm starts anywhere in the interval: phi goes to the upper stop, then theta to the
    // lower one.
    std::vector<CheckedRow> rows;
    PlanningFleet then = fleet;
    for (std::uint32_t i = 1; i < fleet.layout.size(); ++i) {
      if (!(*targets)[i]) continue;
      ++made_way;
      then.start[i] = Exactly(Witness::kReported, *(*targets)[i]);
    }
    for (const std::int32_t theta : {-spread, spread}) {
      const Pose from{somewhere[0] + theta, somewhere[1]};
      then.start[0] = Exactly(Witness::kReported, from);
      const auto units =
          focalfleet::test::CheckedUnits(then.layout, then.drives, then.start, then.frozen);
      const auto& homing = units[0];
      rows = {{homing.id, 1, 0, 20, homing.axis[1].start_deg, homing.axis[1].max_deg},
              {homing.id, 0, 20, 60, homing.axis[0].start_deg, homing.axis[0].min_deg}};
      CheckOptions options;
      options.clearance_mm = fleet.layout.clearance_mm();
      const auto report = focalfleet::test::CheckPlan(units, rows, {}, options);
      for (const std::string& fault : report.faults)
        EXPECT_EQ(fault.find("units " + std::to_string(homing.id) + " and"), std::string::npos)
            << fault;
    }
  }
  EXPECT_GT(made_way, 0);
}

TEST(MakeWayForHoming, RefusesByNameWhatCannotMove) {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6)});
  fleet.StandAt({PoseDeg(fleet, 0, 90, 20), PoseDeg(fleet, 1, 180, 0)});
  fleet.start[0][0] = {Witness::kInterval, PoseDeg(fleet, 0, 60, 0)[0],
                       PoseDeg(fleet, 0, 120, 0)[0]};
  const auto free = MakeWayForHoming(fleet.request(), {0});
  ASSERT_TRUE(free) << free.error().text;
  EXPECT_TRUE((*free)[1]);
  fleet.frozen[1] = 1;
  const auto refused = MakeWayForHoming(fleet.request(), {0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kRefused);
  EXPECT_THAT(refused.error().text, HasSubstr("unit 22"));
}

}  // namespace
}  // namespace focalfleet
