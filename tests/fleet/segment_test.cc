#include "fleet/geometry/segment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

PointFp Along(const SegmentFp& s, double f) {
  return {s.a.x_mm + f * (s.b.x_mm - s.a.x_mm), s.a.y_mm + f * (s.b.y_mm - s.a.y_mm)};
}

TEST(Segment, DistancesOfPlainCases) {
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{0, 3}, {4, 3}}), 3);
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{2, -1}, {2, 1}}), 0);
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{7, 4}, {7, 9}}), 5);
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{4, 0}, {9, 9}}), 0);  // touch at ends
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{6, 0}, {9, 0}}), 2);  // one line
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{2, 0}, {9, 0}}), 0);  // overlap
  EXPECT_EQ(DistanceMm(SegmentFp{{1, 1}, {1, 1}}, SegmentFp{{4, 5}, {4, 5}}), 5);  // two points
}

TEST(Segment, NoPairOfPointsIsNearerAndOneIsAsNear) {
  const std::uint64_t seed = testing::TestSeed(20240611);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  const auto point = [&] { return PointFp{rng.Uniform(-10, 10), rng.Uniform(-10, 10)}; };
  for (int k = 0; k < 2000; ++k) {
    const SegmentFp s{point(), point()};
    const SegmentFp t{point(), point()};
    const double distance = DistanceMm(s, t);
    double least = 1e9;
    for (int i = 0; i <= 50; ++i)
      for (int j = 0; j <= 50; ++j)
        least = std::min(least, DistanceMm(Along(s, i / 50.0), Along(t, j / 50.0)));
    EXPECT_LE(distance, least + 1e-12);
    EXPECT_GE(distance, least - 0.6);  // one step of each segment
    EXPECT_EQ(distance, DistanceMm(t, s));
  }
}

}  // namespace
}  // namespace focalfleet
