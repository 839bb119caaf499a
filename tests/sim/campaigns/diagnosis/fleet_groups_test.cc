#include "sim/campaigns/diagnosis/score/fleet_groups.h"

#include <gtest/gtest.h>

namespace focalfleet::sim {
namespace {

// Two rails of three units.
const FleetGroups kRails{.rail = {0, 0, 0, 1, 1, 1}, .bus = {}, .rails = 2};

TEST(AreTogether, ARailHasItsDroopInMostOfItsUnits) {
  EXPECT_TRUE(AreTogether(Owner::kRail, {0, 0, 0, 1, 1, 1}, kRails));
  EXPECT_TRUE(AreTogether(Owner::kRail, {1, 1, 0, 0, 0, 0}, kRails));
  EXPECT_FALSE(AreTogether(Owner::kRail, {1, 0, 0, 0, 0, 0}, kRails));
  EXPECT_FALSE(AreTogether(Owner::kRail, {1, 1, 1, 0, 0, 1}, kRails));
  EXPECT_TRUE(AreTogether(Owner::kUnit, {1, 0, 0, 0, 0, 0}, kRails));
}

TEST(AreTogether, WhereNoBusIsKnownTheFleetIsOne) {
  EXPECT_FALSE(AreTogether(Owner::kBus, {1, 1, 0, 0, 0, 0}, kRails));
  EXPECT_TRUE(AreTogether(Owner::kBus, {1, 1, 1, 0, 0, 0}, kRails));
}

}  // namespace
}  // namespace focalfleet::sim
