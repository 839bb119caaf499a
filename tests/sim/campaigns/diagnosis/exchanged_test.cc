// Units that make each other's moves.
#include "sim/campaigns/diagnosis/terms/exchanged.h"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::Verdicts;
using testing::Contains;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

// The table has one unit's moves under the other's name from this move on: the measured places are
// those of the other's moves. Pre: both have as many rows; none is homed after it.
void ExchangeMoves(std::size_t a, std::size_t b, std::size_t since, Campaign* campaign) {
  const std::size_t end = campaign->first_row[a + 1] - campaign->first_row[a];
  for (const std::size_t axis : {kTheta, kPhi}) {
    std::vector<double>&from = campaign->from_deg[axis], &cmd = campaign->cmd_deg[axis];
    const auto row = [&](std::size_t unit, std::size_t move) {
      return campaign->first_row[unit] + move;
    };
    const double apart = from[row(a, since)] - from[row(b, since)];
    for (std::size_t i = since; i < end; ++i)
      for (std::vector<double>* angle : {&from, &cmd}) {
        std::swap((*angle)[row(a, i)], (*angle)[row(b, i)]);
        (*angle)[row(a, i)] += apart, (*angle)[row(b, i)] -= apart;
      }
  }
}

TEST(Exchanged, UnitsThatMakeEachOthersMovesAreFound) {
  for (const std::size_t since : {0u, 17u, 40u}) {
    SCOPED_TRACE(since);
    Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.05, .axis = "theta"}},
                                {.units = 24, .moves = 60, .seed = 5});
    ExchangeMoves(3, 11, since, &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_THAT(diagnosis.causes, SizeIs(2)) << Reported(diagnosis);
    const CauseFound& swap = diagnosis.causes[0];
    EXPECT_EQ(swap.cause, "identity_swap");
    EXPECT_THAT(swap.units, ElementsAre(campaign.units[3].id, campaign.units[11].id));
    const std::size_t first = campaign.first_row[3] + since;
    EXPECT_EQ(swap.shape, "each makes the other's moves, since move " +
                              std::to_string(campaign.move_id[first]));
    EXPECT_THAT(diagnosis.causes[1].candidates, Contains("backlash"));
    EXPECT_EQ(diagnosis.outliers.rows, 0u);
  }
}

/// Exchanges the places of two units in these moves.
void ExchangePlacesOf(std::size_t a, std::size_t b, std::size_t begin, std::size_t end,
                      Campaign* campaign) {
  for (std::size_t move = begin; move < end; ++move)
    for (std::vector<double>* place : {&campaign->x_mm, &campaign->y_mm})
      std::swap((*place)[campaign->first_row[a] + move], (*place)[campaign->first_row[b] + move]);
}

TEST(Exchanged, FibresThatHaveEachOthersNameForAWhileAreFound) {
  const struct {
    std::size_t begin, end;
    std::string_view shape;
  } cases[] = {{0, 60, ""},
               {0, 25, "units 4 and 10 in moves 1 to 25"},
               {20, 41, "units 4 and 10 in moves 21 to 41"},
               {52, 60, "units 4 and 10 since move 53"}};
  for (const auto& [begin, end, shape] : cases) {
    SCOPED_TRACE(shape);
    Campaign campaign = Planted({{.cause = "gear_scale", .amplitude = 0.002, .axis = "theta"}},
                                {.units = 24, .moves = 60, .seed = 5, .outlier_share = 0.01});
    const Campaign right = campaign;
    ExchangePlacesOf(3, 9, begin, end, &campaign);
    const std::vector<FibreSwap> swaps = FindFibreSwaps(MakeFacts(campaign));
    ASSERT_THAT(swaps, SizeIs(1));
    Campaign undone = campaign;
    UndoFibreSwap(MakeFacts(campaign).exposures, swaps[0], &undone);
    EXPECT_EQ(undone.x_mm, right.x_mm);
    EXPECT_EQ(undone.y_mm, right.y_mm);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_THAT(diagnosis.causes, SizeIs(2)) << Reported(diagnosis);
    const bool first = diagnosis.causes[0].cause == "identity_swap";  // the clearer is
    const CauseFound &swap = diagnosis.causes[first ? 0 : 1],
                     &scale = diagnosis.causes[first ? 1 : 0];
    EXPECT_EQ(swap.cause, "identity_swap");
    EXPECT_EQ(swap.shape, shape);
    EXPECT_THAT(swap.units, ElementsAre(4u, 10u));
    EXPECT_GT(swap.delta_log_likelihood, 100);
    EXPECT_EQ(scale.cause, "gear_scale");
  }
}

TEST(Exchanged, APairOfOutliersIsNoName) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 5, .outlier_share = 0.05});
  for (const std::size_t move : {7u, 33u}) ExchangePlacesOf(3, 9, move, move + 1, &campaign);
  EXPECT_THAT(FindFibreSwaps(MakeFacts(campaign)), IsEmpty());
}

TEST(Exchanged, NamesMayBeWrongTwiceAndPlacesUnseen) {
  const Campaign right = Planted({}, {.units = 24, .moves = 60, .seed = 5});
  Campaign campaign = right;
  ExchangePlacesOf(3, 9, 10, 20, &campaign);
  ExchangePlacesOf(3, 9, 25, 60, &campaign);
  // Rows that are off, or were not seen, are no evidence about names.
  campaign.x_mm[campaign.first_row[3] + 14] += 1.5;
  campaign.x_mm[campaign.first_row[9] + 59] = std::numeric_limits<double>::quiet_NaN();
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<FibreSwap> swaps = FindFibreSwaps(facts);
  ASSERT_THAT(swaps, SizeIs(1));
  Campaign undone = campaign;
  UndoFibreSwap(facts.exposures, swaps[0], &undone);
  for (std::size_t move = 0; move < 60; ++move)
    if (move != 14 && move != 59) {
      EXPECT_EQ(undone.x_mm[right.first_row[3] + move], right.x_mm[right.first_row[3] + move]);
      EXPECT_EQ(undone.x_mm[right.first_row[9] + move], right.x_mm[right.first_row[9] + move]);
    }
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_THAT(diagnosis.causes, SizeIs(1)) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].shape, "units 4 and 10 in moves 11 to 20 and since move 26");
}

// Exposures are numbered in the order in which they appear, unit by unit.
TEST(Exchanged, OfAFirstUnitThatLacksMovesFollowsNothing) {
  Campaign right = Planted({}, {.units = 24, .moves = 60, .seed = 5});
  std::vector<bool> keep(right.rows(), true);
  for (std::size_t move = 20; move < 30; ++move) keep[right.first_row[0] + move] = false;
  right = Keep(right, keep);
  Campaign campaign = right;
  ExchangePlacesOf(3, 9, 14, 25, &campaign);
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<FibreSwap> swaps = FindFibreSwaps(facts);
  ASSERT_THAT(swaps, SizeIs(1));
  UndoFibreSwap(facts.exposures, swaps[0], &campaign);
  EXPECT_EQ(campaign.x_mm, right.x_mm);
  EXPECT_EQ(campaign.y_mm, right.y_mm);
}

TEST(Exchanged, NamesAreFoundWhereTheTableIsOffForAllUnits) {
  Campaign campaign = Planted({}, {.units = 600, .moves = 8, .seed = 5});
  ExchangePlacesOf(3, 9, 0, 8, &campaign);
  for (double& x_mm : campaign.x_mm) x_mm += 0.5;
  const std::vector<FibreSwap> swaps = FindFibreSwaps(MakeFacts(campaign));
  ASSERT_THAT(swaps, SizeIs(1));
  EXPECT_EQ(swaps[0].a, 3u);
  EXPECT_EQ(swaps[0].b, 9u);
}

// Neighbours that sometimes get each other's spot are no cause of an axis, whatever they are near
// to.
TEST(Exchanged, RowsUnderAnothersNameNowAndThenAreOutliers) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 5});
  std::size_t exchanged = 0;
  for (std::size_t unit = 0; unit + 1 < campaign.units.size(); unit += 2)
    for (const std::size_t move : {5 + unit, 30 + unit}) {
      ExchangePlacesOf(unit, unit + 1, move, move + 1, &campaign);
      exchanged += 2;
    }
  EXPECT_THAT(RowsUnderAnothersName(MakeFacts(campaign)), SizeIs(exchanged));
  const Diagnosis diagnosis = Verdicts(campaign);
  EXPECT_EQ(diagnosis.verdict, Verdict::kConsistent) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.outliers.why.at("at another unit's place"), exchanged);
}

// Random zeros put fibres near others' places by chance, now and then.
TEST(Exchanged, WhereTheTableIsWrongNobodyIsAtAnothersPlace) {
  std::size_t exchanged = 0;
  for (const std::uint64_t seed : {3u, 4u, 5u, 6u}) {
    Campaign campaign = Planted({}, {.units = 60, .moves = 60, .seed = seed});
    Rng rng = Rng::Stream(seed, "zeros");
    for (CampaignUnit& unit : campaign.units) unit.zero_deg[kTheta] += rng.Uniform(-180, 180);
    for (std::size_t unit = 0; unit + 1 < campaign.units.size(); unit += 2)
      ExchangePlacesOf(unit, unit + 1, 7, 8, &campaign);
    exchanged += RowsUnderAnothersName(MakeFacts(campaign)).size();
  }
  EXPECT_EQ(exchanged, 0u);
}

TEST(Exchanged, WhatOneFibreWasSeenAtAloneIsMissingWhileNamesAreWrong) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 30, .seed = 5});
  ExchangePlacesOf(3, 9, 10, 20, &campaign);
  const std::size_t gone = campaign.first_row[9] + 12;  // of the other: as if of another exposure
  campaign.move_id[gone] = 1'000'000;
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<FibreSwap> swaps = FindFibreSwaps(facts);
  ASSERT_THAT(swaps, SizeIs(1));
  UndoFibreSwap(facts.exposures, swaps[0], &campaign);
  EXPECT_TRUE(std::isnan(campaign.x_mm[gone]));
  EXPECT_TRUE(std::isnan(campaign.x_mm[campaign.first_row[3] + 12]));
  EXPECT_TRUE(std::isfinite(campaign.x_mm[campaign.first_row[3] + 13]));
  EXPECT_TRUE(std::isfinite(campaign.x_mm[campaign.first_row[3] + 25]));
}

TEST(Exchanged, UnitsThatObeyNobodyAreNoPair) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = 5});
  Rng rng = Rng::Stream(5, "where they go");
  for (const std::size_t unit : {3u, 11u})
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const PlacePoint at =
          PlaceOf(campaign.units[unit], rng.Uniform(-180, 180), rng.Uniform(0, 180));
      campaign.x_mm[row] = at.x_mm, campaign.y_mm[row] = at.y_mm;
    }
  EXPECT_THAT(FindCommandSwaps(MakeFacts(campaign)), IsEmpty());
  const Diagnosis diagnosis = Verdicts(campaign);
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_NE(cause.cause, "identity_swap") << Reported(diagnosis);
}

TEST(Exchanged, WhatTheOtherHasNoRowOfIsMissing) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 20, .seed = 5});
  ExchangeMoves(3, 11, 5, &campaign);
  const std::size_t gone = campaign.first_row[11] + 12;  // of the other: as if of another exposure
  campaign.move_id[gone] = 1'000'000;
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<CommandSwap> swaps = FindCommandSwaps(facts);
  ASSERT_THAT(swaps, SizeIs(1));
  Campaign undone = campaign;
  UndoCommandSwap(facts, swaps[0], &undone);
  EXPECT_TRUE(std::isnan(undone.x_mm[gone]));
  EXPECT_TRUE(std::isnan(undone.x_mm[campaign.first_row[3] + 12]));
  EXPECT_TRUE(std::isfinite(undone.x_mm[campaign.first_row[3] + 13]));
  EXPECT_TRUE(std::isfinite(undone.x_mm[campaign.first_row[3] + 4]));
  EXPECT_THAT(FindCommandSwaps(MakeFacts(undone)), IsEmpty());
}

}  // namespace
}  // namespace focalfleet::sim
