#include "daemon/clock/wall_time.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(WallTime, PrintsIso8601InUtc) {
  EXPECT_EQ(ToIso8601({1'700'000'000'000'000'000}), "2023-11-14T22:13:20.000Z");
  EXPECT_EQ(ToIso8601({0}), "1970-01-01T00:00:00.000Z");
  EXPECT_EQ(ToIso8601({-1'000'000}), "1969-12-31T23:59:59.999Z");
}

}  // namespace
}  // namespace focalfleet
