#include "daemon/loop/status_thread.h"

#include <gtest/gtest.h>

#include <semaphore>
#include <string>
#include <vector>

namespace focalfleet {
namespace {

/// A publisher that is held up until it is let go, and a record of what it published.
struct Readers {
  std::counting_semaphore<> let{0};
  std::binary_semaphore entered{0};
  std::binary_semaphore room{0};
  std::vector<std::string> log;  // written by the thread, read after its end

  StatusThread::Sinks Sinks() {
    return {.publish =
                [this](const StatusBatch& status) {
                  entered.release();
                  let.acquire();
                  log.push_back(std::to_string(status.units.size()));
                  return false;
                },
            .alarm = [this](const AlarmValue& alarm) { log.push_back(alarm.row.text); },
            .room = [this] { room.release(); }};
  }
};

StatusBatch Units(std::size_t count) {
  StatusBatch status;
  status.units.resize(count);
  return status;
}

TEST(StatusThread, RefusesWhatItHasNoRoomForAndSaysWhenThereIsRoom) {
  Readers readers;
  {
    const auto thread = StatusThread::Create(readers.Sinks()).value();
    StatusBatch first = Units(1);
    ASSERT_TRUE(thread->Publish(&first));
    readers.entered.acquire();  // the thread is in DDS
    std::size_t taken = 0;
    StatusBatch next = Units(2);
    while (taken < 100 && thread->Publish(&next)) {
      ++taken;
      next = Units(2 + taken);
    }
    EXPECT_LT(taken, 10u);
    EXPECT_EQ(next.units.size(), 2 + taken) << "a refused batch is untouched";
    readers.let.release(100);
    readers.room.acquire();
    EXPECT_TRUE(thread->Publish(&next));
  }
  ASSERT_GE(readers.log.size(), 2u);
  for (std::size_t k = 0; k < readers.log.size(); ++k)
    EXPECT_EQ(readers.log[k], std::to_string(k + 1)) << "in order, and none is lost at the end";
}

TEST(StatusThread, AlarmsThatWaitAreBoundedAndTheNewestAreKept) {
  Readers readers;
  {
    const auto thread = StatusThread::Create(readers.Sinks()).value();
    StatusBatch first = Units(1);
    ASSERT_TRUE(thread->Publish(&first));
    readers.entered.acquire();
    for (int k = 0; k < 5000; ++k) {
      AlarmValue alarm;
      alarm.row.text = "alarm " + std::to_string(k);
      thread->Publish(alarm);
    }
    readers.let.release(1);
  }
  EXPECT_LT(readers.log.size(), 2000u);
  EXPECT_EQ(readers.log.back(), "alarm 4999");
}

}  // namespace
}  // namespace focalfleet
