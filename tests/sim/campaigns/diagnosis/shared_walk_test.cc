// Common motion of all units while their noise remembers is compared with independent walks.
#include "sim/campaigns/diagnosis/check/shared_walk.h"

#include <gmock/gmock.h>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::TurnTheta;
using test::Verdicts;

constexpr std::size_t kMoves = 120;

// Theta of all units is off by the exposure's given angle.
Campaign Together(const std::function<double(double share_of_night)>& off_deg, std::uint64_t seed) {
  Campaign campaign = Planted({}, {.units = 24, .moves = kMoves, .seed = seed});
  const Exposures exposures = FindExposures(campaign);
  TurnTheta(
      [&](std::size_t row) { return off_deg(static_cast<double>(exposures.of_row[row]) / kMoves); },
      &campaign);
  return campaign;
}

// Whatever else is said of it, no cause is named for sure.
void ExpectNotSure(const Diagnosis& diagnosis) {
  EXPECT_TRUE(diagnosis.verdict == Verdict::kUnknown || diagnosis.verdict == Verdict::kAmbiguous)
      << Reported(diagnosis);
  for (const CauseFound& cause : diagnosis.causes)
    EXPECT_TRUE(cause.cause == "zero_offset" || cause.candidates.size() > 1) << Reported(diagnosis);
}

// Wear of each unit's own comes within 20 in 2 ln L of one curve for all.
TEST(SharedWalk, AZeroThatAllUnitsDriftByIsNotNoise) {
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    ExpectNotSure(Verdicts(Together([](double share) { return 0.05 * share * share; }, seed)));
  }
}

TEST(SharedWalk, NorOneThatStepsOnce) {
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    ExpectNotSure(Verdicts(Together([](double share) { return share > 0.6 ? 0.03 : 0; }, seed)));
  }
}

// In one of three campaigns a trend in each unit, beside a walk that forgets, explains these walks
// better than a walk does. The cause of such trends is then named, and never for sure.
TEST(SharedWalk, WalksOfTheirOwnAreNoise) {
  std::size_t named = 0;
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    Campaign campaign = Planted({}, {.units = 24, .moves = kMoves, .seed = seed});
    Rng rng = Rng::Stream(seed, "walks");
    std::vector<double> off_deg(campaign.rows());
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      double walk = 0;
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
        if (campaign.cmd_deg[kTheta][row] != campaign.from_deg[kTheta][row])
          walk += 0.01 * rng.Normal();
        off_deg[row] = walk;
      }
    }
    TurnTheta([&](std::size_t row) { return off_deg[row]; }, &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_GT(cause.candidates.size(), 1u) << Reported(diagnosis);
    if (!diagnosis.causes.empty()) ++named;
  }
  EXPECT_LE(named, 1u);
}

}  // namespace
}  // namespace focalfleet::sim
