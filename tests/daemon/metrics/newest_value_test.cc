#include "daemon/metrics/newest_value.h"

#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <thread>

namespace focalfleet {
namespace {

TEST(NewestValue, GivesTheNewestOnce) {
  NewestValue<int> value;
  EXPECT_EQ(value.Take(), nullptr);
  value.Put(std::make_unique<int>(1));
  value.Put(std::make_unique<int>(2));
  EXPECT_EQ(*value.Take(), 2);
  EXPECT_EQ(value.Take(), nullptr);
  value.Put(std::make_unique<int>(3));  // goes with it
}

TEST(NewestValue, GoesForwardBetweenThreads) {
  constexpr int kLast = 20'000;
  NewestValue<int> value;
  std::thread putter([&] {
    for (int i = 1; i <= kLast; ++i) value.Put(std::make_unique<int>(i));
  });
  int newest = 0;
  while (newest < kLast) {
    if (const auto taken = value.Take()) {
      EXPECT_GT(*taken, newest);
      newest = *taken;
    }
  }
  putter.join();
}

}  // namespace
}  // namespace focalfleet
