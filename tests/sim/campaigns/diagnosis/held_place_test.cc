// A unit that comes to rest a little off its place stands there until it moves. Such errors are
// noise, and no cause.
#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "sim/campaigns/diagnosis/model/whiten.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

// Adds an error of the place that is new whenever an axis of the unit moves.
void HoldPlaceErrors(double spread_um, std::uint64_t seed, Campaign* campaign) {
  Rng rng = Rng::Stream(seed, "held places");
  for (std::size_t unit = 0; unit < campaign->units.size(); ++unit) {
    double x_mm = 0, y_mm = 0;
    for (std::size_t row = campaign->first_row[unit]; row < campaign->first_row[unit + 1]; ++row) {
      const bool moves = campaign->cmd_deg[kTheta][row] != campaign->from_deg[kTheta][row] ||
                         campaign->cmd_deg[kPhi][row] != campaign->from_deg[kPhi][row];
      if (moves || row == campaign->first_row[unit])
        x_mm = 1e-3 * spread_um * rng.Normal(), y_mm = 1e-3 * spread_um * rng.Normal();
      campaign->x_mm[row] += x_mm, campaign->y_mm[row] += y_mm;
    }
  }
}

// In every third exposure a unit in two is left where it stands.
void LetUnitsStand(std::uint64_t seed, Campaign* campaign) {
  Rng rng = Rng::Stream(seed, "standing units");
  for (std::size_t unit = 0; unit < campaign->units.size(); ++unit)
    for (std::size_t row = campaign->first_row[unit] + 1; row < campaign->first_row[unit + 1];
         ++row) {
      const bool stands = campaign->move_id[row] % 3 == 0 && rng.Uniform() < 0.5;
      for (const std::size_t axis : {kTheta, kPhi}) {
        campaign->from_deg[axis][row] = campaign->cmd_deg[axis][row - 1];
        if (stands) campaign->cmd_deg[axis][row] = campaign->cmd_deg[axis][row - 1];
      }
      const PlacePoint place = PlaceOf(campaign->units[unit], campaign->cmd_deg[kTheta][row],
                                       campaign->cmd_deg[kPhi][row]);
      constexpr double kCamera_mm = 2e-3;
      campaign->x_mm[row] = place.x_mm + kCamera_mm * rng.Normal();
      campaign->y_mm[row] = place.y_mm + kCamera_mm * rng.Normal();
    }
}

Campaign Held(std::uint64_t seed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = seed});
  LetUnitsStand(seed, &campaign);
  HoldPlaceErrors(5, seed, &campaign);
  return campaign;
}

TEST(HeldPlace, IsFittedAsWhatItIs) {
  const Campaign campaign = Held(3);
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  EXPECT_NEAR(fit.noise.rest_um, 5, 1);
  EXPECT_NEAR(fit.noise.place_um, 2, 0.5);
  double square = 0, next = 0, count = 0;
  for (std::size_t unit = 0; unit < fit.model.units.size(); ++unit) {
    const WhiteUnit white = Whiten(fit, unit);
    for (Eigen::Index i = 0; i + 2 < white.y.size(); ++i)
      square += white.y[i] * white.y[i], next += white.y[i] * white.y[i + 2], count += 1;
  }
  EXPECT_NEAR(square / count, 1, 0.1);
  EXPECT_NEAR(next / square, 0, 4 / std::sqrt(count));
}

class HeldPlaces : public testing::TestWithParam<std::uint64_t> {};

TEST_P(HeldPlaces, HaveNoCause) {
  SCOPED_TRACE("seed " + std::to_string(GetParam()));
  const Diagnosis diagnosis = Verdicts(Held(GetParam()));
  EXPECT_TRUE(diagnosis.causes.empty()) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
}

INSTANTIATE_TEST_SUITE_P(Seeds, HeldPlaces, testing::Values(1, 2, 3, 4));

TEST(OddExposures, AreAStructureThatNoCauseExplains) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
  const std::set<std::int64_t> odd = {campaign.move_id[11], campaign.move_id[12],
                                      campaign.move_id[47]};
  TurnTheta([&](std::size_t row) { return odd.contains(campaign.move_id[row]) ? 0.06 : 0.0; },
            &campaign);
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.causes.empty()) << Reported(diagnosis);
}

TEST(RampTravel, OfHundredthsOfADegreeMayBeARoundingOfTheMoves) {
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "ramp_travel", .amplitude = -0.0015, .axis = "phi"}},
                       {.units = 60, .moves = 100, .seed = 5, .noise_um = 1, .rest_noise_deg = 0}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].candidates,
              testing::UnorderedElementsAre("ramp_travel", "command_quantisation"));
}

}  // namespace
}  // namespace focalfleet::sim
