#include "sim/campaigns/diagnosis/distortion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "sim/campaigns/effects/empirical.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

std::vector<Undistorted> Judged(const Campaign& campaign, const Templates& templates) {
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  const Selection selection = Select(templates, {}, &fit);
  EXPECT_EQ(fit.model.terms.size(), templates.size());
  return BesideDistortions(fit, selection.accepted);
}

Template OnceATurn() {
  return {.effect = FindEffect("eccentricity"), .axis = EffectAxis::kTheta, .columns = 2};
}

Template OfOrder(double order) {
  return {.effect = &EmpiricalRipple(), .axis = EffectAxis::kTheta, .columns = 2, .shape = order};
}

double Turn(const Campaign& campaign, std::size_t row) {
  return campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
}

TEST(Distortion, WhatABentCauseLeavesGoesBesideItsBend) {
  // A wave once a turn is bent: the third order is in it at a ninth of its size.
  Campaign campaign = Planted({}, {.units = 24, .moves = 100, .seed = 21});
  TurnTheta(
      [&](std::size_t row) {
        const double once = 0.3 * std::sin(Turn(campaign, row) + 0.5);
        return once + 2 * once * std::abs(once);
      },
      &campaign);
  const std::vector<Undistorted> judged = Judged(campaign, {OnceATurn(), OfOrder(3)});
  ASSERT_EQ(judged.size(), 2u);
  EXPECT_EQ(judged[0].of, kNoTerm);
  EXPECT_EQ(judged[1].of, 0u);
  EXPECT_TRUE(judged[1].is_misfit_artefact()) << judged[1].kept;
}

TEST(Distortion, AWeakCauseBesideAStrongOneIsKept) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 100, .seed = 21});
  TurnTheta(
      [&](std::size_t row) {
        return 0.5 * std::sin(Turn(campaign, row) + 0.5) +
               0.05 * std::sin(2 * Turn(campaign, row) - 1);
      },
      &campaign);
  const std::vector<Undistorted> judged = Judged(campaign, {OnceATurn(), OfOrder(2)});
  ASSERT_EQ(judged.size(), 2u);
  EXPECT_FALSE(judged[1].is_doubtful()) << judged[1].kept;
}

// The stop's angle in one unit is twice the angle by which the torque turns them all.
TEST(Distortion, WhatIsLargerThanTheStrongOneIsNotWhatItsShapeLeaves) {
  for (const auto& [form, size] : {std::pair(14, 0.05), {16, 0.02}}) {
    const Diagnosis diagnosis =
        Verdicts(Planted({{.cause = "fibre_torque", .amplitude = 0.06, .axis = "phi"},
                          {.cause = "hard_stop",
                           .amplitude = size,
                           .axis = "phi",
                           .unit_share = 0.05,
                           .form = form}},
                         {.units = 24, .moves = 150}));
    ASSERT_EQ(diagnosis.causes.size(), 2u) << Reported(diagnosis);
    EXPECT_EQ(diagnosis.causes[1].cause, "hard_stop") << Reported(diagnosis);
  }
}

}  // namespace
}  // namespace focalfleet::sim
