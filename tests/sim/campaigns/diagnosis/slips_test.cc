// Slips and lost moves of most units, again and again. Their noise hides the others, some come in
// the first move after a homing, and some moves are short.
#include "sim/campaigns/diagnosis/terms/slips.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::TurnTheta;
using test::Verdicts;

struct Slipping {
  Campaign campaign;
  std::size_t slips = 0;
};

// Units whose theta loses a turn of the rotor in this share of its moves, until it is homed.
Slipping Slip(double share, std::size_t units, std::uint64_t seed) {
  Slipping made{.campaign =
                    Planted({}, {.units = units, .moves = 90, .seed = seed, .homing_share = 0.04})};
  Campaign& campaign = made.campaign;
  const std::span<const double> rehomed = campaign.Find("rehomed");
  Rng rng = Rng::Stream(seed, "slips");
  std::vector<double> off_deg(campaign.rows(), 0);
  for (std::size_t unit = 0; unit < units; ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      const bool restarts = row == campaign.first_row[unit] || rehomed[row] > 0.5;
      off_deg[row] = restarts ? 0 : off_deg[row - 1];
      const double step = campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row];
      if (std::abs(step) < 2 || rng.Uniform() >= share) continue;
      off_deg[row] -= std::copysign(360 / campaign.units[unit].gear[kTheta], step);
      ++made.slips;
    }
  TurnTheta([&](std::size_t row) { return off_deg[row]; }, &campaign);
  return made;
}

TEST(Slips, OfMostUnitsAreAllThatIsWrong) {
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    const Slipping made = Slip(0.04, 24, seed);
    const Diagnosis diagnosis = Verdicts(made.campaign);
    ASSERT_FALSE(diagnosis.causes.empty());
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_EQ(cause.cause, "step_loss") << Reported(diagnosis);
    const auto of_phi = std::ranges::count(diagnosis.model.events, kPhi, &EventTerm::axis);
    EXPECT_LE(10 * of_phi, static_cast<std::ptrdiff_t>(made.slips)) << Reported(diagnosis);
    // A slip that the next one undoes, or that no pose shows before the homing, is not seen.
    EXPECT_NEAR(diagnosis.causes[0].amplitude, static_cast<double>(made.slips),
                0.2 * static_cast<double>(made.slips));
    EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
  }
}

TEST(Slips, ArePricedByHowOftenUnitsSlip) {
  const Campaign campaign = Planted({}, {.units = 12, .moves = 80, .seed = 3});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = test::StaticFit(facts);
  const double turn_deg = 360 / campaign.units[0].gear[kTheta];
  const auto known = [&](std::size_t units, std::size_t each) {
    std::vector<EventTerm> slips;
    for (std::size_t unit = 0; unit < units; ++unit)
      for (std::size_t k = 0; k < each; ++k)
        slips.push_back({unit, campaign.first_row[unit] + 5 + k, kTheta, true, -turn_deg});
    return slips;
  };
  const double first = PricesOfFirst(fit, 0.01)[kTheta][0];
  const double of_slipping = PricesByCount(fit, known(3, 6), 0)[kTheta][0];
  const double of_another = PricesByCount(fit, known(3, 6), 9)[kTheta][0];
  EXPECT_LT(of_slipping, first);
  // A unit that has not slipped where others do six times is none that slips.
  EXPECT_GT(of_another, of_slipping + 5);
  EXPECT_LT(PricesByCount(fit, known(10, 6), 0)[kTheta][0],
            PricesByCount(fit, known(10, 1), 0)[kTheta][0]);
  const SlipPrices prices = PricesByCount(fit, known(3, 6), 0);
  EXPECT_GT(prices[kTheta][1], of_slipping) << "all known ones are of one turn";
  EXPECT_GT(prices[kPhi][0], of_slipping) << "and of theta";
}

// Both axes stand where they stood, in this share of all moves, however short, until the homing.
Campaign Lose(double share, std::uint64_t seed, std::size_t* lost) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 90, .seed = seed, .homing_share = 0.04});
  const std::span<const double> rehomed = campaign.Find("rehomed");
  Rng rng = Rng::Stream(seed, "lost");
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    double off_deg[2] = {0, 0};
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      if (rehomed[row] > 0.5) off_deg[kTheta] = off_deg[kPhi] = 0;
      const bool is_lost = rng.Uniform() < share;
      *lost += is_lost ? 1 : 0;
      for (const std::size_t axis : {kTheta, kPhi})
        if (is_lost) off_deg[axis] -= campaign.cmd_deg[axis][row] - campaign.from_deg[axis][row];
      const CampaignUnit& u = campaign.units[unit];
      const auto place = [&](double theta_deg, double phi_deg) {
        return PlaceOf(u, campaign.cmd_deg[kTheta][row] + theta_deg,
                       campaign.cmd_deg[kPhi][row] + phi_deg);
      };
      const PlacePoint is = place(off_deg[kTheta], off_deg[kPhi]), was = place(0, 0);
      campaign.x_mm[row] += is.x_mm - was.x_mm, campaign.y_mm[row] += is.y_mm - was.y_mm;
    }
  }
  return campaign;
}

TEST(LostMoves, ThatAreShortAreNoStictionWhereOthersAreLost) {
  for (const std::uint64_t seed : {3u, 4u, 5u}) {
    SCOPED_TRACE(seed);
    std::size_t lost = 0;
    const Diagnosis diagnosis = Verdicts(Lose(0.03, seed, &lost));
    for (const CauseFound& cause : diagnosis.causes)
      EXPECT_EQ(cause.cause, "lost_command") << Reported(diagnosis);
    ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
    // A move below the noise is not missed.
    EXPECT_NEAR(diagnosis.causes[0].amplitude, static_cast<double>(lost),
                0.35 * static_cast<double>(lost));
  }
}

}  // namespace
}  // namespace focalfleet::sim
