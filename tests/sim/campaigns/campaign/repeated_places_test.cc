#include "sim/campaigns/campaign/repeated_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/sim/campaigns/campaign/odd_places.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::InSteps;
using test::MovedInTurns;
using test::Planted;
using test::ReadTwice;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

Campaign Plain(std::uint64_t seed = 7) {
  return Planted({}, {.units = 24, .moves = 40, .seed = seed});
}

// Rows that were commanded to stay, and have the place before.
std::vector<std::size_t> RowsThatRepeat(const Campaign& campaign) {
  std::vector<std::size_t> rows;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit] + 1; row < campaign.first_row[unit + 1]; ++row)
      if (campaign.x_mm[row] == campaign.x_mm[row - 1] &&
          campaign.cmd_deg[kTheta][row] == campaign.from_deg[kTheta][row] &&
          campaign.cmd_deg[kPhi][row] == campaign.from_deg[kPhi][row])
        rows.push_back(row);
  return rows;
}

// Units that stay, and are measured again.
Campaign AtRest(double noise_mm, std::uint64_t seed = 1) {
  Campaign campaign = MovedInTurns(Plain(), 0.4, true);
  Rng rng = Rng::Stream(seed, "noise");
  for (std::vector<double>* place : {&campaign.x_mm, &campaign.y_mm})
    for (double& at_mm : *place) at_mm += noise_mm * rng.Normal();
  return campaign;
}

// The exposure for which most units are moved by more than a degree of theta.
std::size_t MostMoved(const Campaign& campaign) {
  std::size_t best = 0, most = 0;
  for (std::size_t exposure = 1; exposure < campaign.first_row[1]; ++exposure) {
    std::size_t moved = 0;
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      const std::size_t row = campaign.first_row[unit] + exposure;
      if (std::abs(campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row]) > 1) ++moved;
    }
    if (moved > most) most = moved, best = exposure;
  }
  EXPECT_GT(most, 15u);
  return best;
}

TEST(RepeatedPlaces, OfUnitsThatWereNotMovedAreCarriedOn) {
  for (const double share : {0.9, 0.5, 0.2}) {
    const Campaign campaign = MovedInTurns(Plain(), share, true);
    const RepeatedPlaces found = FindRepeatedPlaces(campaign);
    EXPECT_EQ(found.carried_on, RowsThatRepeat(campaign)) << share;
    EXPECT_FALSE(found.carried_on.empty());
    EXPECT_THAT(found.copied, IsEmpty());
  }
}

// Rounded places are carried on too, as long as the steps are not too wide to show it.
TEST(RepeatedPlaces, ThatAreRoundedAreCarriedOn) {
  for (const double step_mm : {1e-4, 1e-3, 1e-2}) {
    const Campaign campaign = InSteps(MovedInTurns(Plain(), 0.5, true), step_mm);
    EXPECT_GT(FindRepeatedPlaces(campaign).carried_on.size(), 350u) << step_mm;
  }
}

TEST(RepeatedPlaces, ThatAreCarriedOnAreForgotten) {
  Campaign campaign = MovedInTurns(Plain(), 0.5, true);
  const Campaign measured = MovedInTurns(Plain(), 0.5, false);
  EXPECT_FALSE(ForgetRepeatedPlaces(&campaign).empty());
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    ASSERT_EQ(std::isnan(campaign.x_mm[row]), std::isnan(measured.x_mm[row])) << row;
    ASSERT_EQ(std::isnan(campaign.y_mm[row]), std::isnan(measured.y_mm[row])) << row;
  }
}

TEST(RepeatedPlaces, OfUnitsAtRestThatWereMeasuredAreNone) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const Campaign campaign = AtRest(3e-3, seed);
    EXPECT_TRUE(FindRepeatedPlaces(campaign).empty());
    // On a grid about as fine as the noise some places meet by chance; on a coarse one nearly all
    // do.
    for (const double step_mm : {1e-4, 1e-3, 3e-3, 1e-2, 0.2})
      EXPECT_TRUE(FindRepeatedPlaces(InSteps(campaign, step_mm)).empty()) << step_mm;
  }
}

// The units may have been commanded to make long moves, short ones, or none.
TEST(RepeatedPlaces, OfAWholeExposureAreACopy) {
  const Campaign fine = Plain();
  for (std::size_t exposure = 1; exposure < 40; ++exposure) {
    const Campaign campaign = ReadTwice(fine, exposure);
    const RepeatedPlaces found = FindRepeatedPlaces(campaign);
    std::vector<std::size_t> expected;
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
      expected.push_back(campaign.first_row[unit] + exposure);
    EXPECT_EQ(found.copied, expected) << exposure;
    EXPECT_THAT(found.copies, ElementsAre(campaign.move_id[exposure]));
    EXPECT_THAT(found.carried_on, IsEmpty());
  }
}

// Moves of some micrometres, which play may hold back in one unit or another, and never in all.
TEST(RepeatedPlaces, OfAWholeExposureOfShortMovesAreACopy) {
  Campaign campaign = Plain();
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t row = campaign.first_row[unit] + 11;
    for (const std::size_t axis : {kTheta, kPhi})
      campaign.cmd_deg[axis][row] = campaign.cmd_deg[axis][row - 1] + 0.05;
  }
  EXPECT_EQ(FindRepeatedPlaces(ReadTwice(campaign, 11)).copied.size(), campaign.units.size());
  EXPECT_THAT(FindRepeatedPlaces(ReadTwice(campaign, 11, 0.8)).copied, IsEmpty());
}

TEST(RepeatedPlaces, OfMostUnitsThatWereMovedFarAreACopy) {
  const Campaign fine = Plain();
  const std::size_t exposure = MostMoved(fine);
  const Campaign campaign = ReadTwice(fine, exposure, 0.7);
  const RepeatedPlaces found = FindRepeatedPlaces(campaign);
  EXPECT_THAT(found.copies, ElementsAre(campaign.move_id[exposure]));
  EXPECT_GT(found.copied.size(), 10u);
  for (const std::size_t row : found.copied) EXPECT_EQ(campaign.x_mm[row], campaign.x_mm[row - 1]);
  EXPECT_THAT(FindRepeatedPlaces(ReadTwice(fine, exposure, 0.2)).copied, IsEmpty());
}

// A command that was lost, or a unit that is stuck, has names in the diagnosis.
TEST(RepeatedPlaces, OfAUnitThatWasToMoveAreNone) {
  Campaign campaign = Plain();
  for (std::size_t row = campaign.first_row[3] + 1; row < campaign.first_row[4]; ++row) {
    campaign.x_mm[row] = campaign.x_mm[row - 1];
    campaign.y_mm[row] = campaign.y_mm[row - 1];
  }
  for (const std::size_t row : FindRepeatedPlaces(campaign).carried_on)
    EXPECT_EQ(campaign.cmd_deg[kTheta][row], campaign.from_deg[kTheta][row]);
  EXPECT_THAT(FindRepeatedPlaces(campaign).copied, IsEmpty());
}

TEST(RepeatedPlaces, BehindAHomingAreNone) {
  Campaign campaign = MovedInTurns(Plain(), 0.5, true);
  const auto rehomed = std::ranges::find(campaign.covariates, "rehomed", &Covariate::name);
  ASSERT_NE(rehomed, campaign.covariates.end());
  rehomed->values.assign(campaign.rows(), 1);
  EXPECT_THAT(FindRepeatedPlaces(campaign).carried_on, IsEmpty());
}

}  // namespace
}  // namespace focalfleet::sim
