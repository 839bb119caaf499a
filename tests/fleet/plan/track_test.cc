// Motions in time. A track is where its segments put the arm. "Passes clear" holds for all pairs of
// own times that skew, clocks and notice let meet. The oracle samples densely and uses no legs,
// slices or bounds.
#include "fleet/plan/track.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fleet/geometry/turn.h"
#include "tests/fleet/plan/planning.h"

namespace focalfleet {
namespace {

using test::HexFleet;
using test::PlanningFleet;
using test::TestSeed;

TEST(DirectionOf, IsCosineAndSine) {
  Rng rng(TestSeed(11));
  for (int k = 0; k < 100'000; ++k) {
    const double angle = rng.Uniform(-100, 100);
    const Direction direction = DirectionOf(angle);
    ASSERT_NEAR(direction.cos, std::cos(angle), 1e-13) << angle;
    ASSERT_NEAR(direction.sin, std::sin(angle), 1e-13) << angle;
  }
}

struct Motion {
  Pose from{};
  AxisPaths paths;
};

/// A motion of up to three segments an axis, anywhere in range, with waits between them.
Motion DrawMotion(const ArmGeometry& arm, Rng* rng) {
  Motion motion;
  const auto draw = [&](std::size_t k) {
    return static_cast<std::int32_t>(rng->Uniform(arm.range().low[k], arm.range().high[k]));
  };
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    motion.from[k] = draw(k);
    std::int32_t at = motion.from[k];
    double t_s = rng->Uniform(0, 5);
    for (std::uint64_t n = rng->Below(4); n > 0; --n) {
      const std::int32_t to = draw(k);
      if (to == at) continue;
      motion.paths[k].Append({static_cast<std::uint32_t>(t_s * 1e4), to - at, 108});
      t_s += std::abs(to - at) * (108 * 500 / 144e6) + rng->Uniform(0.001, 3);
      at = to;
    }
  }
  return motion;
}

/// Vectors from zero at an own time, straight from the segments.
double At(const Motion& motion, std::size_t axis, double t_s) {
  double at = motion.from[axis];
  for (const Segment& segment : motion.paths[axis].segments()) {
    const double lasts_s = std::abs(segment.delta) * (segment.repeat * 500 / 144e6);
    const double share = std::clamp((t_s - segment.start_ticks * 1e-4) / lasts_s, 0.0, 1.0);
    at += share * segment.delta;
  }
  return at;
}

SegmentFp LineAt(const Unit& unit, const Motion& motion, double t_s) {
  const double per_vector = 2 * std::numbers::pi / (96 * unit.theta().gear);
  const double theta = At(motion, 0, t_s) * per_vector;
  const double beyond = theta + At(motion, 1, t_s) * per_vector;
  SegmentFp line;
  line.a = {unit.base_fp.x_mm + unit.theta().arm_mm * std::cos(theta),
            unit.base_fp.y_mm + unit.theta().arm_mm * std::sin(theta)};
  line.b = {line.a.x_mm + unit.phi().arm_mm * std::cos(beyond),
            line.a.y_mm + unit.phi().arm_mm * std::sin(beyond)};
  return line;
}

TEST(Track, IsWhereItsSegmentsPutIt) {
  const PlanningFleet fleet = HexFleet(2);
  const ArmGeometry arm(fleet.layout.unit({0}), fleet.drives[0]);
  Rng rng(TestSeed(12));
  for (int k = 0; k < 300; ++k) {
    const Motion motion = DrawMotion(arm, &rng);
    const Track track(arm, fleet.drives[0], motion.from, motion.paths);
    for (int n = 0; n < 50; ++n) {
      const double t_s = rng.Uniform(-1, track.end_s() + 2);
      const SegmentFp expected = LineAt(fleet.layout.unit({0}), motion, t_s);
      const auto leg = std::find_if(track.legs().begin(), track.legs().end(),
                                    [t_s](const Leg& l) { return t_s < l.end_s; });
      const SegmentFp line = ArmAt(arm, *leg, t_s);
      ASSERT_NEAR(line.b.x_mm, expected.b.x_mm, 1e-6);
      ASSERT_NEAR(line.b.y_mm, expected.b.y_mm, 1e-6);
      // The arm is within the bounds of its slice, too.
      const Slice& slice = track.slice(static_cast<int>(std::floor(t_s / Track::kSliceS)));
      ASSERT_LE(DistanceMm(line.b, slice.line.b), slice.travel_mm + 1e-9);
      ASSERT_LE(DistanceMm(line.a, slice.line.a), slice.travel_mm + 1e-9);
    }
  }
}

TEST(PassesClear, HoldsForAllTimesThatCanMeetAndNotForMuchMore) {
  const PlanningFleet fleet = HexFleet(2);
  std::array<ArmGeometry, 2> arms{ArmGeometry(fleet.layout.unit({0}), fleet.drives[0]),
                                  ArmGeometry(fleet.layout.unit({1}), fleet.drives[1])};
  const Tolerance tolerance{.start_skew_s = 0.02, .clock_error = 0.005, .notice_s = 0.5};
  Rng rng(TestSeed(13));
  int clear = 0;
  int touching = 0;
  int reserved = 0;
  for (int k = 0; k < 400; ++k) {
    FOCALFLEET_TRACE_SEED(TestSeed(13));
    const std::array<Motion, 2> motions{DrawMotion(arms[0], &rng), DrawMotion(arms[1], &rng)};
    const Track a(arms[0], fleet.drives[0], motions[0].from, motions[0].paths);
    const Track b(arms[1], fleet.drives[1], motions[1].from, motions[1].paths);
    double least_mm = 1e9;
    for (double t = -1; t < std::max(a.end_s(), b.end_s()) + 2; t += 0.04) {
      const SegmentFp line = LineAt(fleet.layout.unit({0}), motions[0], t);
      // The tolerance written out again: starts, clocks of both, and the notice.
      const double slip_s = 0.04 + 0.5 + 0.01 * std::max(t, 0.0);
      for (double d = -slip_s; d <= slip_s; d += slip_s / 12)
        least_mm =
            std::min(least_mm, DistanceMm(line, LineAt(fleet.layout.unit({1}), motions[1], t + d)));
    }
    const double need_mm = rng.Uniform(0.5, 4);
    const bool passes = PassesClear(arms[0], a, arms[1], b, need_mm, tolerance);
    if (passes) {
      EXPECT_GT(least_mm, need_mm);
    }
    if (least_mm > need_mm + 1.0) {
      EXPECT_TRUE(passes) << least_mm << " of " << need_mm;
    }
    ++(passes ? clear : touching);
    if (!passes && least_mm > need_mm) ++reserved;
  }
  EXPECT_GT(clear, 20);
  EXPECT_GT(touching, 20);
  EXPECT_LT(reserved, touching / 4);
}

TEST(LegPassesClear, SeesWhereTheOtherStandsLongAfterItsEnd) {
  const PlanningFleet fleet = HexFleet(2);
  std::array<ArmGeometry, 2> arms{ArmGeometry(fleet.layout.unit({0}), fleet.drives[0]),
                                  ArmGeometry(fleet.layout.unit({1}), fleet.drives[1])};
  const Tolerance tolerance;
  Rng rng(TestSeed(14));
  FOCALFLEET_TRACE_SEED(TestSeed(14));
  int touching = 0;
  for (int k = 0; k < 4000; ++k) {
    const std::array<Motion, 2> motions{DrawMotion(arms[0], &rng), DrawMotion(arms[1], &rng)};
    const Track a(arms[0], fleet.drives[0], motions[0].from, motions[0].paths);
    const Track b(arms[1], fleet.drives[1], motions[1].from, motions[1].paths);
    const SegmentFp stands = LineAt(fleet.layout.unit({1}), motions[1], b.end_s() + 1);
    for (Leg leg : a.legs()) {
      if (leg.stands()) continue;
      const double later_s = 500 - leg.begin_s;
      leg.begin_s += later_s;
      leg.end_s += later_s;
      if (DistanceMm(ArmAt(arms[0], leg, leg.end_s), stands) > 2) continue;
      ++touching;
      EXPECT_FALSE(LegPassesClear(arms[0], leg, arms[1], b, 2, tolerance));
    }
  }
  EXPECT_GT(touching, 20);
}

}  // namespace
}  // namespace focalfleet
