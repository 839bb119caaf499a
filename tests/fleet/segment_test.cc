#include "fleet/geometry/segment.h"

#include <gtest/gtest.h>

#include <algorithm>
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
  /// touching at ends
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{4, 0}, {9, 9}}), 0);
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{6, 0}, {9, 0}}), 2);  // one line
  EXPECT_EQ(DistanceMm(SegmentFp{{0, 0}, {4, 0}}, SegmentFp{{2, 0}, {9, 0}}), 0);  // overlap
  EXPECT_EQ(DistanceMm(SegmentFp{{1, 1}, {1, 1}}, SegmentFp{{4, 5}, {4, 5}}), 5);  // two points
}

TEST(Segment, NoPairOfPointsIsNearerAndOneIsAsNear) {
  const std::uint64_t seed = test::TestSeed(20240611);
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
    EXPECT_NEAR(distance, DistanceMm(t, s), 1e-12);
  }
}

double DoubleArea(PointFp a, PointFp b, PointFp c) {
  return (b.x_mm - a.x_mm) * (c.y_mm - a.y_mm) - (b.y_mm - a.y_mm) * (c.x_mm - a.x_mm);
}

/// The distance: 0 where they cross, otherwise from one of the ends.
double ByCrossingAndEnds(const SegmentFp& s, const SegmentFp& t) {
  const bool s_parts = DoubleArea(s.a, s.b, t.a) * DoubleArea(s.a, s.b, t.b) < 0;
  const bool t_parts = DoubleArea(t.a, t.b, s.a) * DoubleArea(t.a, t.b, s.b) < 0;
  if (s_parts && t_parts) return 0;
  return std::min({DistanceMm(s.a, t), DistanceMm(s.b, t), DistanceMm(t.a, s), DistanceMm(t.b, s)});
}

TEST(Segment, AlmostParallelOnesAreAsFarApartAsTheirEndsSay) {
  const std::uint64_t seed = test::TestSeed(20240612);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int k = 0; k < 200'000; ++k) {
    const double turn = std::pow(10, rng.Uniform(-17, 0)) * (rng.Uniform() < 0.5 ? -1 : 1);
    const double apart = rng.Uniform() < 0.3 ? 0 : std::pow(10, rng.Uniform(-9, 1));
    const double along = rng.Uniform(-10, 10);
    const SegmentFp s{{0, 0}, {8.25, 0}};
    const SegmentFp t{{along, apart},
                      {along + 8.25 * std::cos(turn), apart + 8.25 * std::sin(turn)}};
    const double angle = rng.Uniform(-3, 3);
    const auto turned = [&](PointFp p) {
      return PointFp{400 + p.x_mm * std::cos(angle) - p.y_mm * std::sin(angle),
                     p.x_mm * std::sin(angle) + p.y_mm * std::cos(angle)};
    };
    const SegmentFp u{turned(s.a), turned(s.b)};
    const SegmentFp v{turned(t.a), turned(t.b)};
    EXPECT_NEAR(DistanceMm(u, v), ByCrossingAndEnds(u, v), 1e-6)
        << "turn " << turn << " apart " << apart << " along " << along;
    EXPECT_NEAR(DistanceMm(v, u), ByCrossingAndEnds(u, v), 1e-6);
  }
}

}  // namespace
}  // namespace focalfleet
