#include "daemon/loop/spsc_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

namespace focalfleet {
namespace {

TEST(SpscQueue, GivesBackWhatItCannotTake) {
  SpscQueue<std::unique_ptr<int>> queue(2);
  for (int i = 0; i < 2; ++i) {
    auto item = std::make_unique<int>(i);
    EXPECT_TRUE(queue.Push(&item));
    EXPECT_EQ(item, nullptr);
  }
  auto third = std::make_unique<int>(2);
  EXPECT_FALSE(queue.Push(&third));
  ASSERT_NE(third, nullptr) << "still ours";
  EXPECT_EQ(**queue.Pop(), 0);
  EXPECT_TRUE(queue.Push(&third));
  EXPECT_EQ(**queue.Pop(), 1);
  EXPECT_EQ(**queue.Pop(), 2);
  EXPECT_FALSE(queue.Pop());
}

TEST(SpscQueue, KeepsTheOrderBetweenTwoThreads) {
  SpscQueue<int> queue(64);
  constexpr int kItems = 5000;
  std::thread giver([&] {
    for (int i = 0; i < kItems;) {
      int item = i;
      if (queue.Push(&item))
        ++i;
      else
        std::this_thread::yield();
    }
  });
  int expected = 0;
  while (expected < kItems) {
    const auto item = queue.Pop();
    if (!item) {
      std::this_thread::yield();
      continue;
    }
    ASSERT_EQ(*item, expected);
    ++expected;
  }
  giver.join();
  EXPECT_EQ(queue.size(), 0u);
}

}  // namespace
}  // namespace focalfleet
