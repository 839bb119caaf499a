// Causes with one amplitude for both axes are compared with those that have one on each.
#include "sim/campaigns/diagnosis/search/both_axes.h"

#include <gmock/gmock.h>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::Verdicts;

// The same number of units moves at once in all moves.
Campaign PlayOfBothAxes(double play_deg, std::uint64_t seed) {
  Campaign campaign = Planted({{.cause = "backlash", .amplitude = play_deg, .axis = "theta"},
                               {.cause = "backlash", .amplitude = play_deg, .axis = "phi"}},
                              {.units = 24, .moves = 80, .seed = seed});
  std::ranges::fill(
      std::ranges::find(campaign.covariates, "movers_on_rail", &Covariate::name)->values, 12);
  return campaign;
}

// Each axis alone explains half of what a droop of both does.
TEST(BothAxes, PlayOfBothIsNoDroop) {
  for (const double play_deg : {0.004, 0.008, 0.02})
    for (const std::uint64_t seed : {3u, 4u}) {
      SCOPED_TRACE(testing::Message() << play_deg << " deg, seed " << seed);
      const Diagnosis diagnosis = Verdicts(PlayOfBothAxes(play_deg, seed));
      EXPECT_TRUE(play_deg < 0.01 || !diagnosis.causes.empty()) << Reported(diagnosis);
      for (const CauseFound& cause : diagnosis.causes) {
        if (play_deg > 0.01) {
          EXPECT_THAT(cause.candidates, testing::Contains("backlash")) << Reported(diagnosis);
        } else {  // too faint for a name
          EXPECT_TRUE(cause.cause != "supply_droop" || cause.candidates.size() > 1)
              << Reported(diagnosis);
        }
      }
    }
}

// Large play on one axis explains next to nothing, because the other axis' play is noise to it. In
// moves of one drive, with no known places on the rail, a droop is the same step of both axes.
TEST(BothAxes, ALargePlayOfBothIsNoDroopEither) {
  Campaign campaign = PlayOfBothAxes(0.4, 3);
  std::erase_if(campaign.covariates,
                [](const Covariate& column) { return column.name == "rail_slot"; });
  std::ranges::fill(
      std::ranges::find(campaign.covariates, "drive_amplitude", &Covariate::name)->values, 1);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_FALSE(diagnosis.causes.empty());
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_TRUE(cause.cause != "supply_droop" ||
                std::ranges::find(cause.candidates, "backlash") != cause.candidates.end())
        << Reported(diagnosis);
}

TEST(BothAxes, ADroopOfBothKeepsItsName) {
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "supply_droop", .amplitude = 0.05, .axis = "both"}},
                       {.units = 24, .moves = 80, .seed = 3}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "supply_droop");
  EXPECT_EQ(diagnosis.causes[0].axis, "both");
}

// Units' own amplitudes on each axis follow whatever the skew does to a unit, for many more
// parameters and no better than chance.
TEST(BothAxes, AStartSkewIsNoPlayOfEachUnit) {
  for (const std::uint64_t seed : {3u, 4u}) {
    const Diagnosis diagnosis =
        Verdicts(Planted({{.cause = "start_skew", .amplitude = 0.05, .axis = "both"}},
                         {.units = 24, .moves = 80, .seed = seed}));
    ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
    EXPECT_THAT(diagnosis.causes[0].candidates, testing::ElementsAre("start_skew"))
        << Reported(diagnosis);
  }
}

}  // namespace
}  // namespace focalfleet::sim
