#include "fleet/coordinate/start_skew.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

ClockMap::Instant Began(std::int64_t earliest_ms, std::int64_t at_ms, std::int64_t latest_ms) {
  const auto after = [](std::int64_t ms) { return HostInstant{} + Milliseconds(ms); };
  return {.at = after(at_ms), .earliest = after(earliest_ms), .latest = after(latest_ms)};
}

// All units were given one instant: the uncertainty of a start is no skew.
TEST(StartSkew, WideStartsProveNothingAndMakeNothingLikely) {
  StartSkew skew;
  skew.Add({1}, Began(0, 10, 100));
  skew.Add({2}, Began(20, 90, 120));
  EXPECT_EQ(skew.reported(), 2u);
  EXPECT_EQ(skew.least(), Milliseconds(0));
  EXPECT_EQ(skew.likely(), Milliseconds(0));
  EXPECT_EQ(skew.most(), Milliseconds(120));
}

TEST(StartSkew, IsThatOfTheStartsThatAreWellKnown) {
  StartSkew skew;
  skew.Add({1}, Began(50, 51, 52));
  skew.Add({2}, Began(0, 80, 120));
  skew.Add({3}, Began(53, 54, 56));
  EXPECT_EQ(skew.least(), Milliseconds(1));
  EXPECT_EQ(skew.likely(), Milliseconds(3));
  EXPECT_EQ(skew.most(), Milliseconds(120));
  EXPECT_EQ(skew.first(), PositionerIndex{1});
  EXPECT_EQ(skew.last(), PositionerIndex{3});
}

// The likeliest last unit may be known so badly that another unit proves more.
TEST(StartSkew, NamesTheTwoThatProveTheLeast) {
  StartSkew skew;
  skew.Add({1}, Began(0, 1, 2));
  skew.Add({2}, Began(-50, 0, 60));
  skew.Add({3}, Began(70, 71, 72));
  skew.Add({4}, Began(10, 80, 150));
  EXPECT_EQ(skew.surely_first().unit, PositionerIndex{1});
  EXPECT_EQ(skew.surely_last().unit, PositionerIndex{3});
  EXPECT_EQ(skew.least(), Milliseconds(68));
  EXPECT_EQ(skew.likely(), Milliseconds(70));
  EXPECT_EQ(skew.most(), Milliseconds(200));
}

TEST(StartSkew, OfAWideStartCountsWhatItProves) {
  StartSkew skew;
  skew.Add({1}, Began(0, 1, 2));
  skew.Add({2}, Began(0, 2, 3));
  skew.Add({5}, Began(90, 150, 200));
  EXPECT_EQ(skew.least(), Milliseconds(88));
  EXPECT_EQ(skew.likely(), Milliseconds(88));
  EXPECT_EQ(skew.first(), PositionerIndex{1});
  EXPECT_EQ(skew.last(), PositionerIndex{5});
}

TEST(StartSkew, OneStartAloneIsNoSkew) {
  StartSkew skew;
  skew.Add({1}, Began(0, 5, 10));
  EXPECT_EQ(skew.least(), Milliseconds(0));
  EXPECT_EQ(skew.likely(), Milliseconds(0));
  skew.Clear();
  EXPECT_EQ(skew.reported(), 0u);
}

}  // namespace
}  // namespace focalfleet
