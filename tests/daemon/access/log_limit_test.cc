#include "daemon/access/log_limit.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(LogLimit, CountsWhatItLeavesOut) {
  LogLimit limit(2);
  EXPECT_EQ(limit.Admit(Seconds(1), "a"), "a");
  EXPECT_EQ(limit.Admit(Seconds(2), "b"), "b");
  for (int n = 0; n < 5; ++n) EXPECT_EQ(limit.Admit(Seconds(60), "c"), "");
  EXPECT_EQ(limit.Admit(Seconds(61), "d"), "d (5 such lines were left out)");
  EXPECT_EQ(limit.Admit(Seconds(62), "e"), "e");
  EXPECT_EQ(limit.Admit(Seconds(63), "f"), "");
  EXPECT_EQ(limit.Admit(Seconds(10), "g"), "g (1 such lines were left out)") << "a step back";
}

}  // namespace
}  // namespace focalfleet
