#include "sim/world.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/sim/rig.h"

namespace focalfleet::sim {
namespace {

using testing::FleetOf;
using testing::kGear;
using testing::MakeMove;
using testing::Rig;

constexpr double kDegPerVector = 360 / (96 * kGear);

TEST(World, CarriesAUnitThroughAMoveAndSaysSo) {
  Rig rig(FleetOf(1, 3));
  const UnitTruth before = rig.world().Truth(UnitId{2});
  ASSERT_EQ(rig.StageAndArm(0, 2, MakeMove(7, 2000, -1000)), Answer::kOk);
  rig.Send(0, 255, Start{{7}, 100});
  rig.Run(Milliseconds(11));
  EXPECT_EQ(rig.world().Truth(UnitId{2}).state, UnitState::kMoving);
  EXPECT_TRUE(rig.world().flash(UnitId{2}).moving);
  rig.heard().clear();
  rig.RunWatched(Milliseconds(2000));
  ASSERT_EQ(rig.heard().size(), 1u);
  const auto done = DecodeUnit(rig.heard()[0].frame);
  ASSERT_TRUE(done && std::holds_alternative<Done>(done->message));
  const Done& said = std::get<Done>(done->message);
  EXPECT_EQ(said.outcome, Outcome::kArrived);
  EXPECT_EQ(said.move, MoveId{7});
  EXPECT_EQ(said.position[0], before.applied[0] + 2000);
  EXPECT_EQ(said.position[1], before.applied[1] - 1000);
  const UnitTruth after = rig.world().Truth(UnitId{2});
  EXPECT_EQ(after.state, UnitState::kRest);
  EXPECT_EQ(after.moves_begun, 1u);
  EXPECT_EQ(after.begun_twice, 0u);
  EXPECT_FALSE(rig.world().flash(UnitId{2}).moving);
  // 15 electrical degrees are 4 of 96 vectors; the load varies by a fifth.
  EXPECT_NEAR(after.vectors[0], said.position[0] - 4, 1.0);
  EXPECT_NEAR(after.vectors[1], said.position[1] + 4, 1.0);
  EXPECT_NEAR(after.angle_deg[0], after.vectors[0] * kDegPerVector, 1e-9);
}

}  // namespace
}  // namespace focalfleet::sim
