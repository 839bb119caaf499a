// Fibres that touch push each other apart, whatever law the push follows.
#include "sim/campaigns/diagnosis/terms/pushed_apart.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <vector>

#include "sim/campaigns/effects/track.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::Verdicts;

// Two neighbours in one exposure.
struct Near {
  double distance_mm;  // of their fibres, as commanded
  std::size_t unit[2], row[2];
};

// The campaign in which the fibres that come nearest push each other apart: three pairs of units,
// each in one exposure. These far rows are too few for a cluster.
Campaign PushApart(std::uint64_t seed) {
  constexpr std::size_t kMoves = 70;
  constexpr double kPush_mm = 0.15;
  Campaign campaign = Planted({}, {.units = 30, .moves = kMoves, .seed = seed});
  const CampaignFacts facts = MakeFacts(campaign);
  const auto commanded = [&](std::size_t unit, std::size_t row) {
    return PlaceOf(campaign.units[unit], campaign.cmd_deg[kTheta][row],
                   campaign.cmd_deg[kPhi][row]);
  };
  std::vector<Near> all;
  for (std::size_t a = 0; a < facts.neighbours.size(); ++a)
    for (const std::size_t b : facts.neighbours[a])
      for (std::size_t k = 0; k < kMoves; ++k) {
        const std::size_t own = campaign.first_row[a] + k, other = campaign.first_row[b] + k;
        const PlacePoint at = commanded(a, own), its = commanded(b, other);
        all.push_back({std::hypot(at.x_mm - its.x_mm, at.y_mm - its.y_mm), {a, b}, {own, other}});
      }
  std::ranges::sort(all, {}, &Near::distance_mm);
  std::set<std::size_t> units;
  for (const Near& near : all) {
    if (units.size() == 6) break;
    if (units.contains(near.unit[0]) || units.contains(near.unit[1])) continue;
    units.insert({near.unit[0], near.unit[1]});
    const PlacePoint at[2] = {commanded(near.unit[0], near.row[0]),
                              commanded(near.unit[1], near.row[1])};
    for (std::size_t one = 0; one < 2; ++one) {
      campaign.x_mm[near.row[one]] +=
          kPush_mm * (at[one].x_mm - at[1 - one].x_mm) / near.distance_mm;
      campaign.y_mm[near.row[one]] +=
          kPush_mm * (at[one].y_mm - at[1 - one].y_mm) / near.distance_mm;
    }
  }
  return campaign;
}

TEST(PushedApart, NeighboursThatAreFarAwayFromEachOtherHaveTouched) {
  for (const std::uint64_t seed : {11u, 12u, 13u}) {
    const Diagnosis diagnosis = Verdicts(PushApart(seed));
    EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << seed << Reported(diagnosis);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << seed << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[0].cause, "collision_contact");
    EXPECT_EQ(diagnosis.causes[0].amplitude, 3);
    EXPECT_EQ(diagnosis.causes[0].units.size(), 6u);
    EXPECT_NEAR(diagnosis.causes[0].size_um, 150, 10);
  }
}

// Neighbours that are far in the same exposure, anywhere and in any direction.
TEST(PushedApart, NeighboursThatAreFarInAnyDirectionHaveNot) {
  for (const std::uint64_t seed : {11u, 12u, 13u, 14u, 15u, 16u}) {
    Campaign campaign = Planted({}, {.units = 30, .moves = 70, .seed = seed});
    const CampaignFacts facts = MakeFacts(campaign);
    Rng rng = Rng::Stream(seed, "any direction");
    for (int pair = 0; pair < 12; ++pair) {
      const std::size_t a = rng.Below(30), k = rng.Below(70);
      const std::size_t b = facts.neighbours[a][rng.Below(facts.neighbours[a].size())];
      for (const std::size_t unit : {a, b}) {
        const double along = rng.Uniform(0, 2 * std::numbers::pi);
        campaign.x_mm[campaign.first_row[unit] + k] += 0.3 * std::cos(along);
        campaign.y_mm[campaign.first_row[unit] + k] += 0.3 * std::sin(along);
      }
    }
    const Diagnosis diagnosis = Verdicts(campaign);
    EXPECT_GE(diagnosis.outliers.rows, 20u);
    EXPECT_TRUE(diagnosis.causes.empty()) << seed << Reported(diagnosis);
  }
}

TEST(PushedApart, IsUnknownToALibraryWithoutContacts) {
  const Diagnosis diagnosis = Verdicts(PushApart(12), {.leave_out = {"collision_contact"}});
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
  ASSERT_FALSE(diagnosis.unknown.empty());
  EXPECT_EQ(diagnosis.unknown.front().covariate, kArmGap);
}

}  // namespace
}  // namespace focalfleet::sim
