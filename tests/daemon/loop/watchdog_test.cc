#include "daemon/loop/watchdog.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <latch>
#include <string>
#include <vector>

#include "daemon/loop/job_thread.h"
#include "daemon/loop/store_thread.h"

namespace focalfleet {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A watchdog of two threads that answer when the test says so.
struct Kennel {
  Kennel()
      : watchdog({{"store", &store, [this] { ++store_woken; }},
                  {"planner", &planner, [this] { ++planner_woken; }}},
                 {.period = Seconds(10),
                  .limit = Seconds(20),
                  .feed = [this] { ++fed; },
                  .log_error = [this](const std::string& text) { errors.push_back(text); },
                  .log_info = [this](const std::string& text) { infos.push_back(text); }}) {}
  /// Serves the watchdog whenever it wants to be, until `end`.
  void PassUntil(HostInstant end) {
    for (; now < end; now = std::min(end, watchdog.wake_at())) watchdog.Serve(now);
    watchdog.Serve(now);
  }

  Heartbeat store;
  Heartbeat planner;
  int store_woken = 0;
  int planner_woken = 0;
  int fed = 0;
  std::vector<std::string> errors;
  std::vector<std::string> infos;
  HostInstant now{0};
  Watchdog watchdog;
};

TEST(Heartbeat, AnAnswerToAnEarlierQuestionDoesNotCount) {
  Heartbeat heartbeat;
  EXPECT_TRUE(heartbeat.answered()) << "nothing was asked";
  EXPECT_FALSE(heartbeat.Answer());
  heartbeat.Ask();
  EXPECT_FALSE(heartbeat.answered());
  EXPECT_TRUE(heartbeat.Answer());
  EXPECT_FALSE(heartbeat.Answer()) << "it has its answer";
  EXPECT_TRUE(heartbeat.answered());
  heartbeat.Ask();
  EXPECT_FALSE(heartbeat.answered());
}

TEST(Watchdog, FeedsAfterEachThreadAnsweredAndNotBefore) {
  Kennel kennel;
  kennel.watchdog.Serve({0});
  EXPECT_EQ(kennel.store_woken, 1) << "a thread that sleeps is woken";
  EXPECT_EQ(kennel.planner_woken, 1);
  kennel.store.Answer();
  kennel.watchdog.Serve({1});
  EXPECT_EQ(kennel.fed, 0) << "the planner has not answered";
  kennel.planner.Answer();
  kennel.watchdog.Serve({2});
  EXPECT_EQ(kennel.fed, 1);
  EXPECT_EQ(kennel.watchdog.wake_at(), HostInstant{0} + Seconds(10));
  kennel.store.Answer();
  kennel.watchdog.Serve({3});
  EXPECT_EQ(kennel.fed, 1) << "the next sign of life needs a question and an answer of its own";
  kennel.watchdog.Serve(HostInstant{0} + Seconds(10));
  EXPECT_EQ(kennel.store_woken, 2);
  EXPECT_EQ(kennel.fed, 1);
}

TEST(Watchdog, NamesAThreadThatDoesNotAnswerOnceAndFeedsNothing) {
  Kennel kennel;
  kennel.watchdog.Serve({0});
  kennel.planner.Answer();
  kennel.PassUntil(HostInstant{0} + Seconds(19));
  EXPECT_THAT(kennel.errors, IsEmpty()) << "the limit has not passed";
  kennel.PassUntil(HostInstant{0} + Seconds(21));
  EXPECT_THAT(kennel.errors, ElementsAre(HasSubstr("no answer from the store thread")));
  EXPECT_THAT(kennel.watchdog.trouble(), HasSubstr("store thread"));
  kennel.PassUntil(HostInstant{0} + Seconds(1000));
  EXPECT_EQ(kennel.errors.size(), 1u);
  EXPECT_EQ(kennel.fed, 0);
  kennel.store.Answer();
  kennel.watchdog.Serve(kennel.now);
  EXPECT_EQ(kennel.fed, 1);
  EXPECT_EQ(kennel.watchdog.trouble(), "");
  EXPECT_THAT(kennel.infos, ElementsAre("all threads answer again"));
}

TEST(Watchdog, APauseOfTheWholeProcessIsNoSilenceOfAThread) {
  Kennel kennel;
  kennel.watchdog.Serve({0});
  kennel.watchdog.Serve(HostInstant{0} + Seconds(3600));  // the core was paused, too
  EXPECT_THAT(kennel.errors, IsEmpty());
  kennel.store.Answer();
  kennel.planner.Answer();
  kennel.watchdog.Serve(HostInstant{0} + Seconds(3600) + Milliseconds(1));
  EXPECT_EQ(kennel.fed, 1);
}

/// Sleeps until a thread raises the signal, as the event loop does. A hang ends as a failure.
template <class Predicate>
bool Await(const EventSignal& signal, const Predicate& done) {
  for (int i = 0; i < 1000 && !done(); ++i) signal.Wait(std::chrono::milliseconds(10));
  return done();
}

TEST(Watchdog, AJobThreadAnswersWhileItSleepsAndNotWhileAJobBlocks) {
  const auto signal = EventSignal::Create().value();
  Heartbeat heartbeat;
  std::latch begun(1);
  std::latch go_on(1);
  const auto thread = JobThread<int, int>::Create(
                          [&](const int& job, const std::atomic<bool>&) {
                            begun.count_down();
                            go_on.wait();
                            return job;
                          },
                          &signal,
                          {.name = "jobs",
                           .alive =
                               [&] {
                                 if (heartbeat.Answer()) signal.Raise();
                               }})
                          .value();
  heartbeat.Ask();
  thread->Wake();
  EXPECT_TRUE(Await(signal, [&] { return heartbeat.answered(); }));
  int job = 1;
  ASSERT_TRUE(thread->Submit(&job));
  begun.wait();
  heartbeat.Ask();
  thread->Wake();
  EXPECT_FALSE(heartbeat.answered());
  go_on.count_down();
  EXPECT_TRUE(Await(signal, [&] { return heartbeat.answered(); }));
}

TEST(Watchdog, AStoreThreadAnswersWhileItSleepsAndNotWhileACommitBlocks) {
  const auto signal = EventSignal::Create().value();
  Heartbeat heartbeat;
  std::latch begun(1);
  std::latch go_on(1);
  StoreThread::Sinks sinks{.commit = [&](std::span<const Row>, WallTime, std::size_t*) -> Status {
                             begun.count_down();
                             go_on.wait();
                             return {};
                           },
                           .publish = [](StatusBatch*) { return true; },
                           .alarm = [](const AlarmValue&) {},
                           .log_error = [](const std::string&) {},
                           .log_info = [](const std::string&) {},
                           .alive =
                               [&] {
                                 if (heartbeat.Answer()) signal.Raise();
                               }};
  const auto thread = StoreThread::Create(std::move(sinks), &signal).value();
  heartbeat.Ask();
  thread->Wake();
  EXPECT_TRUE(Await(signal, [&] { return heartbeat.answered(); }));
  thread->Commit(1, {EnableRow{.unit = UnitId{1}, .enabled = true, .reason = "x"}});
  begun.wait();
  heartbeat.Ask();
  thread->Wake();
  EXPECT_FALSE(heartbeat.answered());
  go_on.count_down();
  EXPECT_TRUE(Await(signal, [&] { return heartbeat.answered(); }));
  EXPECT_TRUE(thread->Finish());
}

}  // namespace
}  // namespace focalfleet
