#include "sim/campaigns/diagnosis/check/gain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <utility>
#include <vector>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::ExchangePlaces;
using test::Planted;
using test::Reported;
using test::StaticFit;

TEST(HeldOutGain, OutliersOfAHomingThatNoFitHasSeenDoNotMoveItsZeros) {
  // The zeros of a held-out homing are fitted to its own few moves, of which some lie anywhere
  // within 2 mm.
  const Campaign campaign = Planted(
      {}, {.units = 24, .moves = 100, .seed = 12, .outlier_share = 0.05, .homing_share = 0.1});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  FreeHomings(&fit);
  const HeldOutGain gain = MeasureGain(fit);
  ASSERT_THAT(gain.held_out,
              testing::HasSubstr("the two zeros of a homing that is held out whole"));
  EXPECT_LT(gain.rms_after_um, 1.5 * gain.noise_floor_um);
  EXPECT_LT(gain.rms_before_um, 1.5 * gain.noise_floor_um);
}

TEST(HeldOutGain, NamesThatWereExchangedCountBeforeAndNotAfter) {
  Campaign campaign = Planted({});
  ExchangePlaces(3, 9, &campaign);
  campaign.x_mm[campaign.first_row[3] + 7] = campaign.y_mm[campaign.first_row[3] + 7] =
      std::numeric_limits<double>::quiet_NaN();  // one was not seen
  const Diagnosis diagnosis = Diagnose(campaign, {});
  EXPECT_GT(diagnosis.gain.rms_before_um, 500) << Reported(diagnosis);
  EXPECT_LT(diagnosis.gain.rms_after_um, 1.3 * diagnosis.gain.noise_floor_um)
      << Reported(diagnosis);
}

}  // namespace
}  // namespace focalfleet::sim
