#include "daemon/planner_thread.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <latch>

namespace focalfleet {
namespace {

TEST(PlannerThread, AnswersEachJobInOrder) {
  const auto done = EventSignal::Create().value();
  const auto thread = PlannerThread::Create(
                          [](const PlannerWork& work) {
                            return PlanDone{.job = work.job.job, .plan = Plan{}};
                          },
                          &done)
                          .value();
  for (std::uint64_t job = 1; job <= 4; ++job) {
    PlannerWork work;
    work.job.job = job;
    ASSERT_TRUE(thread->Submit(&work));
  }
  std::vector<std::uint64_t> answered;
  for (int i = 0; i < 1000 && answered.size() < 4; ++i) {
    while (auto plan = thread->Take()) answered.push_back(plan->job);
    pollfd poller{done.fd(), POLLIN, 0};
    ::poll(&poller, 1, 10);
    done.Clear();
  }
  EXPECT_EQ(answered, (std::vector<std::uint64_t>{1, 2, 3, 4}));
}

TEST(PlannerThread, RefusesMoreThanItHasRoomFor) {
  const auto done = EventSignal::Create().value();
  std::latch go(1);
  const auto thread = PlannerThread::Create(
                          [&](const PlannerWork& work) {
                            go.wait();
                            return PlanDone{.job = work.job.job, .plan = Plan{}};
                          },
                          &done)
                          .value();
  int taken = 0;
  for (int i = 0; i < 100; ++i) {
    PlannerWork work;
    taken += thread->Submit(&work) ? 1 : 0;
  }
  EXPECT_GE(taken, 8);
  EXPECT_LT(taken, 100);
  go.count_down();
}

}  // namespace
}  // namespace focalfleet
