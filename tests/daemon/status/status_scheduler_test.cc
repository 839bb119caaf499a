#include "daemon/status/status_scheduler.h"

#include <gtest/gtest.h>

#include "tests/daemon/verbs/small_fleet.h"

namespace focalfleet {
namespace {

using test::SmallFleet;

class StatusSchedulerTest : public ::testing::Test {
 protected:
  StatusBatch TakeAt(std::int64_t ms) {
    return scheduler_.Take(fleet_.View(HostInstant{} + Milliseconds(ms)), 7, false);
  }

  SmallFleet fleet_;
  StatusScheduler scheduler_{3, {.rate_hz = 10, .version = "1", .started = {}}, HostClock()};
};

TEST_F(StatusSchedulerTest, PublishesAllUnitsAtTheStart) {
  EXPECT_TRUE(scheduler_.due(HostInstant{}));
  const StatusBatch batch = TakeAt(0);
  EXPECT_EQ(batch.units.size(), 3u);
  EXPECT_EQ(batch.buses.size(), 1u);
  ASSERT_TRUE(batch.fleet);
  EXPECT_EQ(batch.fleet->units, 3u);
  EXPECT_TRUE(batch.configuration);
  EXPECT_EQ(batch.after_batch, 7u);
}

TEST_F(StatusSchedulerTest, ThenOnlyChangedUnitsAndNotFasterThanTheRate) {
  TakeAt(0);
  scheduler_.Changed(std::vector<PositionerIndex>{{1}});
  EXPECT_FALSE(scheduler_.due(HostInstant{} + Milliseconds(99)));
  EXPECT_TRUE(scheduler_.due(HostInstant{} + Milliseconds(100)));
  const StatusBatch batch = TakeAt(100);
  ASSERT_EQ(batch.units.size(), 1u);
  EXPECT_EQ(batch.units[0].unit, UnitId{2});
}

TEST_F(StatusSchedulerTest, TheFleetIsReportedEachSecondInAnyCase) {
  TakeAt(0);
  EXPECT_FALSE(scheduler_.due(HostInstant{} + Milliseconds(900)));
  EXPECT_TRUE(scheduler_.due(HostInstant{} + Milliseconds(1000)));
  EXPECT_TRUE(TakeAt(1000).units.empty());
}

TEST_F(StatusSchedulerTest, ABatchThatWasNotTakenIsPublishedAgain) {
  const StatusBatch batch = TakeAt(0);
  scheduler_.GiveBack(batch, fleet_.layout());
  EXPECT_EQ(TakeAt(100).units.size(), 3u);
}

}  // namespace
}  // namespace focalfleet
