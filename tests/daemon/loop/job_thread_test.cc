#include "daemon/loop/job_thread.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <latch>
#include <vector>

namespace focalfleet {
namespace {

TEST(JobThread, AnswersEachJobInOrder) {
  const auto done = EventSignal::Create().value();
  const auto thread = JobThread<int, int>::Create(
                          [](const int& job, const std::atomic<bool>&) { return 10 * job; }, &done)
                          .value();
  for (int job = 1; job <= 4; ++job) {
    int copy = job;
    ASSERT_TRUE(thread->Submit(&copy));
  }
  std::vector<int> answered;
  for (int i = 0; i < 1000 && answered.size() < 4; ++i) {
    while (auto answer = thread->Take()) answered.push_back(*answer);
    pollfd poller{done.fd(), POLLIN, 0};
    ::poll(&poller, 1, 10);
    done.Clear();
  }
  EXPECT_EQ(answered, (std::vector<int>{10, 20, 30, 40}));
}

TEST(JobThread, RefusesMoreThanItHasRoomFor) {
  const auto done = EventSignal::Create().value();
  std::latch go(1);
  const auto thread = JobThread<int, int>::Create(
                          [&](const int& job, const std::atomic<bool>&) {
                            go.wait();
                            return job;
                          },
                          &done)
                          .value();
  int taken = 0;
  for (int i = 0; i < 100; ++i) {
    int job = i;
    taken += thread->Submit(&job) ? 1 : 0;
  }
  EXPECT_GE(taken, 8);
  EXPECT_LT(taken, 100);
  go.count_down();
}

}  // namespace
}  // namespace focalfleet
