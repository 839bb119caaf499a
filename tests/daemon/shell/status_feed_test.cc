#include "daemon/status_feed.h"

#include <gtest/gtest.h>

#include "tests/daemon/shell/small_fleet.h"

namespace focalfleet {
namespace {

class StatusFeedTest : public ::testing::Test {
 protected:
  StatusBatch TakeAt(std::int64_t ms) {
    return feed_.Take(fleet_.View(HostInstant{} + Milliseconds(ms)), 7, false);
  }

  SmallFleet fleet_;
  StatusFeed feed_{3, {.rate_hz = 10, .version = "1", .started = {}}, HostClock()};
};

TEST_F(StatusFeedTest, TellsAllUnitsAtTheStart) {
  EXPECT_TRUE(feed_.due(HostInstant{}));
  const StatusBatch batch = TakeAt(0);
  EXPECT_EQ(batch.units.size(), 3u);
  EXPECT_EQ(batch.buses.size(), 1u);
  ASSERT_TRUE(batch.fleet);
  EXPECT_EQ(batch.fleet->units, 3u);
  EXPECT_TRUE(batch.configuration);
  EXPECT_EQ(batch.after_batch, 7u);
}

TEST_F(StatusFeedTest, ThenOnlyWhatChangedAndNotFasterThanTheRate) {
  TakeAt(0);
  feed_.Changed(std::vector<PositionerIndex>{{1}});
  EXPECT_FALSE(feed_.due(HostInstant{} + Milliseconds(99)));
  EXPECT_TRUE(feed_.due(HostInstant{} + Milliseconds(100)));
  const StatusBatch batch = TakeAt(100);
  ASSERT_EQ(batch.units.size(), 1u);
  EXPECT_EQ(batch.units[0].unit, UnitId{2});
}

TEST_F(StatusFeedTest, TheFleetIsToldEachSecondInAnyCase) {
  TakeAt(0);
  EXPECT_FALSE(feed_.due(HostInstant{} + Milliseconds(900)));
  EXPECT_TRUE(feed_.due(HostInstant{} + Milliseconds(1000)));
  EXPECT_TRUE(TakeAt(1000).units.empty());
}

TEST_F(StatusFeedTest, WhatWasNotTakenIsToldAgain) {
  const StatusBatch batch = TakeAt(0);
  feed_.GiveBack(batch, fleet_.layout());
  EXPECT_EQ(TakeAt(100).units.size(), 3u);
}

}  // namespace
}  // namespace focalfleet
