// Where each unit was seen after few moves, the fits of the units absorb much of the noise, and an
// exposure shows few units. The rest of the noise must not look like causes. Four of 40 such
// campaigns are still given one, each of a single unit: more than the 1 % that is aimed at.
#include <gmock/gmock.h>

#include <cmath>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::Verdicts;

TEST(FewMoves, NoiseOfTwelveMovesMakesNoName) {
  int count = 0;
  std::string reported;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Campaign campaign = Planted({}, {.units = 60, .moves = 12, .seed = seed});
    const Diagnosis diagnosis = Verdicts(campaign);
    if (diagnosis.verdict == Verdict::kConsistent) continue;
    reported += "seed " + std::to_string(seed) + ": " + Reported(diagnosis) + "\n";
    ++count;
  }
  EXPECT_LE(count, 1) << reported;
}

// In each exposure a third of the units is moved and seen: 18 places, of which the camera has a
// part of the noise alone.
TEST(FewMoves, ExposuresOfFewUnitsHaveTheNoiseOfAll) {
  Campaign campaign = Planted({}, {.units = 60, .moves = 40, .seed = 12});
  Rng rng = Rng::Stream(12, "units seen");
  for (std::size_t row = 0; row < campaign.rows(); ++row)
    if (rng.Uniform() > 0.3) campaign.x_mm[row] = campaign.y_mm[row] = std::nan("");
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  for (const double factor : fit.noise.exposure_factor) {
    EXPECT_GT(factor, 0.5);
    EXPECT_LT(factor, 2);
  }
}

// In some units the moves hide an eccentricity behind zeros and arms. These units have it, too:
// otherwise their zeros take it up, and differ from the table for no reason.
TEST(FewMoves, UnitsWhoseGeometryHidesTheEffectHaveItToo) {
  const Campaign campaign =
      Planted({{"eccentricity", 0.05, "phi"}}, {.units = 150, .moves = 24, .seed = 5});
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "eccentricity");
  EXPECT_EQ(diagnosis.causes[0].units.size(), campaign.units.size());
  // Each unit's own errors make the length of its two amplitudes too long.
  EXPECT_NEAR(diagnosis.causes[0].amplitude, 0.05, 0.005);
}

}  // namespace
}  // namespace focalfleet::sim
