#include "fleet/plan/plan.h"

#include <gtest/gtest.h>

namespace focalfleet {
namespace {

TEST(Plan, PositionAndSpanFollowTheSegments) {
  AxisPath path;
  path.Append({100, 40, 108});
  path.Append({2000, -70, 216});
  const AxisDrive drive;
  const double vector_s = SecondsPerVector(drive);
  EXPECT_EQ(PositionAt(7, path, drive, 0), 7);
  EXPECT_EQ(PositionAt(7, path, drive, 0.0099), 7);
  EXPECT_EQ(PositionAt(7, path, drive, 0.01 + vector_s / 2), 8);
  EXPECT_EQ(PositionAt(7, path, drive, 0.01 + 39.5 * vector_s), 47);
  EXPECT_EQ(PositionAt(7, path, drive, 0.19), 47);
  EXPECT_EQ(PositionAt(7, path, drive, 0.2 + vector_s), 46);
  EXPECT_EQ(PositionAt(7, path, drive, 100), -23);
  const Span span = SpanOf(7, path);
  EXPECT_EQ(span.low, -23);
  EXPECT_EQ(span.high, 47);
  UnitPlan plan;
  plan.path[0] = path;
  EXPECT_NEAR(EndOf(plan, UnitDrive{}), 0.2 + 70 * 2 * vector_s, 1e-12);
}

}  // namespace
}  // namespace focalfleet
