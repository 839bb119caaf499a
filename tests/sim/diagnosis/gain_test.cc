#include "sim/diagnosis/gain.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "tests/sim/diagnosis/planted_campaign.h"

namespace focalfleet::sim {
namespace {

TEST(HeldOutGain, OutliersOfAHomingThatNoFitHasSeenDoNotMoveItsZeros) {
  // Zeros that differ by a degree from homing to homing: those of a held-out homing are fitted to
  // its own few moves, of which some lie anywhere within 2 mm.
  Campaign campaign =
      Planted({}, {.moves = 100, .seed = 12, .outlier_share = 0.05, .homing_share = 0.1});
  const CampaignFacts facts = MakeFacts(campaign);
  Rng rng = Rng::Stream(12, "zeros of homings");
  double zero_deg = 0;
  TurnTheta(
      [&](std::size_t row) {
        if (facts.restarts[row] != 0) zero_deg = rng.Uniform(-1, 1);
        return zero_deg;
      },
      &campaign);
  const Diagnosis diagnosis = Diagnose(campaign, {});
  ASSERT_THAT(diagnosis.gain.held_out, testing::HasSubstr("homing")) << Told(diagnosis);
  EXPECT_LT(diagnosis.gain.rms_after_um, 1.3 * diagnosis.gain.noise_floor_um) << Told(diagnosis);
  EXPECT_LT(diagnosis.gain.rms_before_um, 1.3 * diagnosis.gain.noise_floor_um) << Told(diagnosis);
}

TEST(HeldOutGain, NamesThatWereExchangedCountBeforeAndNotAfter) {
  Campaign campaign = Planted({});
  for (std::size_t i = 0; i < 60; ++i) {
    const std::size_t a = campaign.first_row[3] + i, b = campaign.first_row[9] + i;
    std::swap(campaign.x_mm[a], campaign.x_mm[b]);
    std::swap(campaign.y_mm[a], campaign.y_mm[b]);
  }
  const Diagnosis diagnosis = Diagnose(campaign, {});
  EXPECT_GT(diagnosis.gain.rms_before_um, 500) << Told(diagnosis);
  EXPECT_LT(diagnosis.gain.rms_after_um, 1.3 * diagnosis.gain.noise_floor_um) << Told(diagnosis);
}

}  // namespace
}  // namespace focalfleet::sim
