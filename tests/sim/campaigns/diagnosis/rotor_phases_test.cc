// Rotors of neighbours pull at each other, and nobody knows where they stand in their motors.
#include "sim/campaigns/diagnosis/terms/rotor_phases.h"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "protocol/base/rng.h"
#include "protocol/base/units.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::kPull_deg;
using test::Planted;
using test::Pulled;
using test::RandomPhases_deg;
using test::Reported;
using test::StaticFit;
using test::Verdicts;

double Apart_deg(double a_deg, double b_deg) {
  return std::abs(std::remainder(a_deg - b_deg, 360));
}

TEST(RotorPhases, AreFoundButForWhatAllHaveInCommon) {
  const std::vector<double> phases_deg = RandomPhases_deg(24, 5);
  const Campaign campaign = Pulled(phases_deg, 5);
  const CampaignFacts facts = MakeFacts(campaign);
  const auto found_deg = FindRotorPhases(StaticFit(facts), kTheta);
  ASSERT_EQ(found_deg.size(), phases_deg.size());
  for (std::size_t u = 0; u < phases_deg.size(); ++u)
    for (const std::size_t v : facts.neighbours[u])
      EXPECT_LT(Apart_deg(found_deg.at(campaign.units[u].id) - found_deg.at(campaign.units[v].id),
                          phases_deg[u] - phases_deg[v]),
                45)  // at 60 moves; any angle up to 180 were chance
          << u << " and " << v;
}

TEST(RotorPhases, APullIsNamedWhereverTheRotorsStand) {
  const Diagnosis diagnosis = Verdicts(Pulled(RandomPhases_deg(24, 6), 6));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates, testing::ElementsAre("neighbour_coupling"));
  EXPECT_NEAR(diagnosis.causes[0].amplitude, kPull_deg, 0.1 * kPull_deg);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
}

// Noise has phases that suit it best, too.
TEST(RotorPhases, ChanceIsNoPull) {
  for (const std::uint64_t seed : {3u, 4u, 5u, 6u}) {
    const Diagnosis diagnosis = Verdicts(Planted({}, {.units = 37, .moves = 24, .seed = seed}));
    EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << seed << Reported(diagnosis);
  }
}

TEST(RotorPhases, OneUnitAloneHasNone) {
  const Campaign campaign = Planted({}, {.units = 1, .moves = 40, .seed = 3});
  const CampaignFacts facts = MakeFacts(campaign);
  EXPECT_TRUE(FindRotorPhases(StaticFit(facts), kTheta).empty());
}

}  // namespace
}  // namespace focalfleet::sim
