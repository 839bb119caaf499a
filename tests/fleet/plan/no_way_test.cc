// A proof that no way exists is never given where a search finds a way. The proof is given where a
// wall of known thickness stands between start and target.
#include "fleet/plan/no_way.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "fleet/hex_layout.h"
#include "fleet/plan/scene.h"
#include "protocol/base/rng.h"
#include "tests/support/seed.h"

namespace focalfleet {
namespace {

class NoWayTest : public ::testing::Test {
 protected:
  [[nodiscard]] std::int32_t Vectors(Axis axis, double degrees) const {
    return static_cast<std::int32_t>(degrees * std::numbers::pi / 180 / arm_.step_rad(axis));
  }
  [[nodiscard]] Pose At(double theta_deg, double phi_deg) const {
    return {Vectors(Axis::kTheta, theta_deg), Vectors(Axis::kPhi, phi_deg)};
  }
  static Blocker Disc(double x_mm, double y_mm, double radius_mm) {
    const PointFp at{x_mm, y_mm};
    return {{{at, at}, radius_mm}, 2, kNoUnitIndex};
  }

  std::vector<Unit> units_ = MakeHexLayout({.count = 1});
  UnitDrive drive_;
  ArmGeometry arm_{units_[0], drive_};
};

TEST_F(NoWayTest, IsProvenWhereTheElbowCannotPass) {
  const double elbow_mm = arm_.theta_arm_mm();
  const std::vector<Blocker> both{Disc(0, elbow_mm, 1), Disc(0, -elbow_mm, 1)};
  const auto proof =
      ProveNoWay({.arm = &arm_, .never_move = both, .from = At(0, 90), .to = At(179, 90)});
  ASSERT_TRUE(proof);
  EXPECT_TRUE(proof->obstacle);
  // A single one of them is not on the way between these two.
  const std::vector<Blocker> one{both[1]};
  EXPECT_FALSE(ProveNoWay({.arm = &arm_, .never_move = one, .from = At(0, 90), .to = At(179, 90)}));
}

TEST_F(NoWayTest, NeverContradictsAWayThatASearchFinds) {
  const std::uint64_t seed = test::TestSeed(430);
  FOCALFLEET_TRACE_SEED(seed);
  Rng rng = Rng::Stream(seed, "no way");
  PathSearch search;
  int proven = 0;
  int found = 0;
  for (int n = 0; n < 300; ++n) {
    std::vector<Blocker> blockers;
    for (std::uint64_t k = 2 + rng.Below(5); k > 0; --k) {
      const double radius_mm = rng.Uniform(5, 18);
      const double angle = rng.Uniform(-std::numbers::pi, std::numbers::pi);
      blockers.push_back(Disc(radius_mm * std::cos(angle), radius_mm * std::sin(angle), 0.5));
    }
    const auto draw = [&]() -> std::optional<Pose> {
      for (int tries = 0; tries < 50; ++tries) {
        const Pose pose = At(rng.Uniform(-170, 170), rng.Uniform(5, 175));
        if (SweepClear(arm_, Sweep::Of(pose), blockers, nullptr)) return pose;
      }
      return std::nullopt;
    };
    const auto from = draw();
    const auto to = draw();
    if (!from || !to) continue;
    const bool way = !search
                          .Find({.arm = &arm_,
                                 .drive = &drive_,
                                 .blockers = blockers,
                                 .from = *from,
                                 .within = RangeAround(arm_, *from),
                                 .goal = PoseBox::Of(*to),
                                 .grid_deg = 2})
                          .empty();
    const bool none =
        ProveNoWay({.arm = &arm_, .never_move = blockers, .from = *from, .to = *to}).has_value();
    EXPECT_FALSE(way && none) << "case " << n;
    // Between the two are gaps narrower than the search's grid and walls thinner than the boxes.
    if (way) ++found;
    if (none) ++proven;
  }
  EXPECT_GT(found, 50);
  EXPECT_GT(proven, 20);
}

}  // namespace
}  // namespace focalfleet
