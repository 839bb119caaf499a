#include "fleet/geometry/arm.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "fleet/kinematics.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

using test::TestSeed;

Unit RandomUnit(Rng* rng, double x_mm) {
  Unit unit;
  unit.base_fp = {x_mm, rng->Uniform(-3, 3)};
  unit.axis[0] = {rng->Uniform(6, 9), rng->Uniform(-180, 180), 892.0588, -195, 195};
  unit.axis[1] = {rng->Uniform(6, 9), rng->Uniform(-20, 20), 892.0588, -5, 190};
  unit.arm_half_width_mm = 2;
  return unit;
}

Pose RandomPose(Rng* rng, const ArmGeometry& arm) {
  Pose pose{};
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const auto width = static_cast<std::uint64_t>(arm.range().high[k] - arm.range().low[k]) + 1;
    pose[k] = arm.range().low[k] + static_cast<std::int32_t>(rng->Below(width));
  }
  return pose;
}

Sweep RandomSweep(Rng* rng, const ArmGeometry& arm) {
  Sweep sweep;
  sweep.from = RandomPose(rng, arm);
  sweep.to = sweep.from;
  const double reach = rng->Uniform(0, 1);
  for (std::size_t k = 0; k < kAxisCount; ++k) {
    const double way = (RandomPose(rng, arm)[k] - sweep.from[k]) * reach;
    if (rng->Uniform() < 0.7) sweep.to[k] += static_cast<std::int32_t>(way);
  }
  const double kind = rng->Uniform();
  sweep.out_of_step = kind < 0.4 ? 1 : kind * 0.05;
  return sweep;
}

Pose PoseIn(Rng* rng, const Sweep& sweep) {
  const double f = rng->Uniform();
  const double g = sweep.out_of_step >= 1
                       ? rng->Uniform()
                       : std::clamp(f + rng->Uniform(-1, 1) * sweep.out_of_step, 0.0, 1.0);
  const double fractions[] = {f, g};
  Pose pose{};
  for (std::size_t k = 0; k < kAxisCount; ++k)
    pose[k] = sweep.from[k] +
              static_cast<std::int32_t>(std::trunc((sweep.to[k] - sweep.from[k]) * fractions[k]));
  return pose;
}

TEST(ArmGeometry, AgreesWithTheKinematics) {
  const std::uint64_t seed = TestSeed(1);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int draw = 0; draw < 1000; ++draw) {
    const Unit unit = RandomUnit(&rng, 0);
    const ArmGeometry arm(unit, UnitDrive{});
    const Pose pose = RandomPose(&rng, arm);
    const SegmentFp expected = ArmAt(unit, UnitDrive{}, pose);
    const SegmentFp line = arm.At(pose);
    EXPECT_LT(DistanceMm(line.a, expected.a), 1e-9);
    EXPECT_LT(DistanceMm(line.b, expected.b), 1e-9);
    EXPECT_LE(DistanceMm(line.b, unit.base_fp), arm.FibreRadiusMax(pose[1], pose[1]) + 1e-9);
  }
}

TEST(ArmGeometry, FibreRadiusBoundsTheWholeRange) {
  const std::uint64_t seed = TestSeed(2);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int draw = 0; draw < 300; ++draw) {
    const Unit unit = RandomUnit(&rng, 0);
    const ArmGeometry arm(unit, UnitDrive{});
    const std::int32_t one = RandomPose(&rng, arm)[1];
    const std::int32_t other = RandomPose(&rng, arm)[1];
    const auto [low, high] = std::minmax(one, other);
    const double bound = arm.FibreRadiusMax(low, high);
    double largest = 0;
    for (int k = 0; k <= 500; ++k) {
      const Pose pose{0, low + static_cast<std::int32_t>((high - low) * std::int64_t{k} / 500)};
      largest = std::max(largest, DistanceMm(arm.At(pose).b, unit.base_fp));
    }
    EXPECT_LE(largest, bound + 1e-9);
    EXPECT_GE(largest, bound - 0.02);
  }
}

/// The property that everything rests on: "clear" is never returned for sweeps that touch.
TEST(SweepsClear, NeverOverlooksAContact) {
  const std::uint64_t seed = TestSeed(3);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  int clear = 0;
  int touching = 0;
  for (int draw = 0; draw < 1500; ++draw) {
    const ArmGeometry a(RandomUnit(&rng, 0), UnitDrive{});
    const ArmGeometry b(RandomUnit(&rng, rng.Uniform(14, 30)), UnitDrive{});
    const Sweep sweep_a = RandomSweep(&rng, a);
    const Sweep sweep_b = RandomSweep(&rng, b);
    double least = 1e9;
    for (int sample = 0; sample < 400; ++sample)
      least = std::min(least, DistanceMm(a.At(PoseIn(&rng, sweep_a)), b.At(PoseIn(&rng, sweep_b))));
    const double need = 4.4;
    const bool said_clear = SweepsClear(a, sweep_a, b, sweep_b, need);
    if (said_clear) {
      EXPECT_GT(least, need);
    }
    ++(said_clear ? clear : touching);
    // Sweeps well clear of each other must be recognised, otherwise nothing could ever move.
    if (least > need + 3) {
      EXPECT_TRUE(said_clear) << "draw " << draw << ", sampled least distance " << least;
    }
  }
  EXPECT_GT(clear, 200);
  EXPECT_GT(touching, 100);
}

TEST(SweepClearOf, NeverOverlooksAContactWithWhatStands) {
  const std::uint64_t seed = TestSeed(4);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng(seed);
  for (int draw = 0; draw < 1500; ++draw) {
    const ArmGeometry a(RandomUnit(&rng, 0), UnitDrive{});
    const ArmGeometry b(RandomUnit(&rng, rng.Uniform(14, 30)), UnitDrive{});
    const Sweep sweep = RandomSweep(&rng, a);
    const Capsule standing{b.At(RandomPose(&rng, b)), rng.Uniform(0, 1)};
    double least = 1e9;
    for (int sample = 0; sample < 300; ++sample)
      least = std::min(least, DistanceMm(a.At(PoseIn(&rng, sweep)), standing.line));
    const double need = 4.4;
    if (SweepClearOf(a, sweep, standing, need)) {
      EXPECT_GT(least, need + standing.radius_mm);
    } else {
      EXPECT_LT(least, need + standing.radius_mm + 3);
    }
  }
}

TEST(SweepsClear, FollowsABandWhereTheBoxWouldTouch) {
  // An arm that slides back along itself between two points that its box of angles runs over.
  Unit unit;
  unit.base_fp = {0, 0};
  unit.axis[0] = {8.25, 0, 892.0588, -190, 190};
  unit.axis[1] = {8.25, 0, 892.0588, 0, 180};
  const ArmGeometry arm(unit, UnitDrive{});
  const auto pose = [&](double theta_deg, double phi_deg) {
    return Pose{NearestVectors(theta_deg, unit.axis[0], {}),
                NearestVectors(phi_deg, unit.axis[1], {})};
  };
  // theta falls while phi grows twice as fast: the fibre goes straight towards the base.
  const Pose from = pose(-10, 20);
  const Pose to = pose(-50, 100);
  const PointFp beside{12, 3};
  const Capsule stone{{beside, beside}, 0};
  EXPECT_TRUE(SweepClearOf(arm, {from, to, 0.01}, stone, 2.5));
  EXPECT_FALSE(SweepClearOf(arm, {from, to, 1}, stone, 2.5));
}

}  // namespace
}  // namespace focalfleet
