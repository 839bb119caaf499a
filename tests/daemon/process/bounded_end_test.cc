#include "daemon/process/bounded_end.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <latch>

#include "daemon/loop/job_thread.h"

namespace focalfleet {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::chrono::milliseconds kPatience{60'000};  // limit for a hang; nothing is timed

TEST(BoundedEnd, WaitsForAllThatEnd) {
  int ended = 0;
  BoundedEnd all({{"a", [] {}}, {"b", [&ended] { ended = 1; }}});
  EXPECT_THAT(all.Wait(kPatience), IsEmpty());
  EXPECT_EQ(ended, 1);
  EXPECT_THAT(BoundedEnd({}).Wait(kPatience), IsEmpty());
}

TEST(BoundedEnd, NamesPartsThatHangAndGoesOn) {
  std::latch go(1);
  std::latch other_ended(1);
  BoundedEnd all({{"the camera", [&go] { go.wait(); }},
                  {"the planner", [&other_ended] { other_ended.count_down(); }}});
  other_ended.wait();
  for (auto left = all.Wait({}); left.size() > 1; left = all.Wait(std::chrono::milliseconds(10))) {
  }
  EXPECT_THAT(all.Wait(std::chrono::milliseconds(20)), ElementsAre("the camera"));
  go.count_down();
  EXPECT_THAT(all.Wait(kPatience), IsEmpty());
}

TEST(BoundedEnd, AJobThatNeverEndsIsNamed) {
  const auto done = EventSignal::Create().value();
  std::latch begun(1);
  std::latch go(1);
  auto thread = JobThread<int, int>::Create(
                    [&](const int& job, const std::atomic<bool>&) {
                      begun.count_down();
                      go.wait();
                      return job;
                    },
                    &done)
                    .value();
  int job = 1;
  ASSERT_TRUE(thread->Submit(&job));
  begun.wait();
  BoundedEnd all({{"the planner", [&thread] { thread.reset(); }}});
  EXPECT_THAT(all.Wait(std::chrono::milliseconds(20)), ElementsAre("the planner"));
  go.count_down();
  EXPECT_THAT(all.Wait(kPatience), IsEmpty());
}

}  // namespace
}  // namespace focalfleet
