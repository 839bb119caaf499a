#include "fleet/coordinate/approach_choice.h"

#include <gtest/gtest.h>

#include "fleet/geometry/clearance.h"
#include "fleet/kinematics.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::FleetOf;
using test::PlanningFleet;
using test::PoseDeg;
using test::UnitAt;

// Unit 0 wishes to turn to where unit 1 reaches; unit 2 stands on the other side of unit 1.
struct Row {
  PlanningFleet fleet = FleetOf({UnitAt(11, 0), UnitAt(22, 25.6), UnitAt(33, 51.2)});
  std::vector<ApproachWish> units = std::vector<ApproachWish>(3);

  Row() {
    units[0] = {PoseDeg(fleet, 0, 90, 20), {PoseDeg(fleet, 0, 0, 20)}};
    units[1] = {PoseDeg(fleet, 1, 180, 20), {}};
    units[2] = {PoseDeg(fleet, 2, 90, 170), {}};
  }
  [[nodiscard]] std::vector<std::optional<Pose>> Choose() const {
    return ChooseApproaches(fleet.layout, fleet.drives, units, 0.02);
  }
};

TEST(ApproachChoice, AUnitWithoutRoomStays) {
  const Row row;
  const auto chosen = row.Choose();
  for (std::size_t n = 0; n < 3; ++n) EXPECT_EQ(chosen[n], row.units[n].otherwise);
}

TEST(ApproachChoice, ANeighbourIsMovedAsideForAUnitWithoutRoom) {
  Row row;
  row.units[1].aside = {PoseDeg(row.fleet, 1, 175, 20), PoseDeg(row.fleet, 1, 90, 20)};
  const auto chosen = row.Choose();
  EXPECT_EQ(chosen[0], row.units[0].wished[0]);
  EXPECT_EQ(chosen[1], row.units[1].aside[1]) << "the first that makes room";
  EXPECT_EQ(chosen[2], row.units[2].otherwise);
}

TEST(ApproachChoice, NoUnitIsMovedAsideInVain) {
  Row row;
  // Unit 1 would not make room on the one side, and would meet unit 2 on the other.
  row.units[2].otherwise = PoseDeg(row.fleet, 2, 180, 20);
  row.units[1].aside = {PoseDeg(row.fleet, 1, 175, 20), PoseDeg(row.fleet, 1, 0, 20)};
  const auto chosen = row.Choose();
  for (std::size_t n = 0; n < 3; ++n) EXPECT_EQ(chosen[n], row.units[n].otherwise);
}

TEST(ApproachChoice, NoUnitIsMovedAsideForOneThatHasRoom) {
  Row row;
  row.units[0].wished.push_back(PoseDeg(row.fleet, 0, 120, 20));
  row.units[1].aside = {PoseDeg(row.fleet, 1, 90, 20)};
  const auto chosen = row.Choose();
  EXPECT_EQ(chosen[0], row.units[0].wished[1]);
  EXPECT_EQ(chosen[1], row.units[1].otherwise);
}

}  // namespace
}  // namespace focalfleet
