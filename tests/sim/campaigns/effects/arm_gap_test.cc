// Gaps between arms are compared with points sampled along them.
#include "sim/campaigns/effects/arm_gap.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "protocol/base/rng.h"

namespace focalfleet::sim {
namespace {

// Two units side by side, one row each.
Campaign Pair(Rng* rng) {
  Campaign campaign;
  for (const std::uint32_t id : {1u, 2u}) {
    CampaignUnit unit;
    unit.id = id;
    unit.base_x_mm = id == 1 ? 0 : 20;
    unit.arm_mm[kTheta] = unit.arm_mm[kPhi] = 8.25;
    campaign.units.push_back(unit);
    campaign.move_id.push_back(1);
    for (const std::size_t axis : {kTheta, kPhi}) {
      campaign.from_deg[axis].push_back(0);
      campaign.cmd_deg[axis].push_back(rng->Uniform(-180, 180));
    }
    campaign.x_mm.push_back(0), campaign.y_mm.push_back(0);
  }
  campaign.first_row = {0, 1, 2};
  return campaign;
}

double SampledGap(const Campaign& campaign, double phi_more_deg) {
  constexpr int kPoints = 400;
  double least = 1e300;
  for (int a = 0; a <= kPoints; ++a)
    for (int b = 0; b <= kPoints; ++b) {
      double x[2], y[2];
      for (const std::size_t u : {0u, 1u}) {
        const CampaignUnit& unit = campaign.units[u];
        const double share = static_cast<double>(u == 0 ? a : b) / kPoints;
        const double theta = campaign.cmd_deg[kTheta][u] * std::numbers::pi / 180;
        const double phi = theta + (campaign.cmd_deg[kPhi][u] + (u == 0 ? phi_more_deg : 0)) *
                                       std::numbers::pi / 180;
        x[u] = unit.base_x_mm + 8.25 * std::cos(theta) + share * 8.25 * std::cos(phi);
        y[u] = unit.base_y_mm + 8.25 * std::sin(theta) + share * 8.25 * std::sin(phi);
      }
      least = std::min(least, std::hypot(x[0] - x[1], y[0] - y[1]));
    }
  return least;
}

TEST(ArmGap, IsTheLeastDistanceOfPointsAlongTheArms) {
  Rng rng = Rng::Stream(5, "arm gaps");
  for (int round = 0; round < 40; ++round) {
    const Campaign campaign = Pair(&rng);
    const ArmGaps gaps = FindArmGaps(campaign, FindExposures(campaign), {{1}, {0}}, 50);
    const double sampled = SampledGap(campaign, 0);
    EXPECT_NEAR(gaps.gap_mm[0], sampled, 0.03) << "round " << round;
    EXPECT_NEAR(gaps.gap_mm[1], gaps.gap_mm[0], 1e-9) << "round " << round;
    const double more = SampledGap(campaign, 2), less = SampledGap(campaign, -2);
    if (std::abs(more - less) > 0.05) {
      EXPECT_EQ(gaps.side[0], more > less ? 1 : -1) << "round " << round;
    }
  }
}

TEST(ArmGap, WithoutNeighboursIsThePitch) {
  Rng rng = Rng::Stream(6, "arm gaps");
  const Campaign campaign = Pair(&rng);
  const ArmGaps gaps = FindArmGaps(campaign, FindExposures(campaign), {{}, {}}, 21);
  EXPECT_EQ(gaps.gap_mm[0], 21);
  EXPECT_EQ(gaps.side[0], 0);
}

}  // namespace
}  // namespace focalfleet::sim
