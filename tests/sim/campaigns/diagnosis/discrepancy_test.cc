#include "sim/campaigns/diagnosis/model/discrepancy.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "sim/campaigns/diagnosis/search/select.h"
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

Template OnceATurn() {
  return {.effect = FindEffect("eccentricity"), .axis = EffectAxis::kTheta, .columns = 2};
}

Template OfOrder(double order) {
  return {.effect = &EmpiricalRipple(), .axis = EffectAxis::kTheta, .columns = 2, .shape = order};
}

double Turn(const Campaign& campaign, std::size_t row) {
  return campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
}

// The chi-square of a ripple of this order beside a wave once a turn.
double Explains(const Campaign& campaign, double order, bool has_discrepancy) {
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  fit.has_discrepancy = has_discrepancy;
  Select({OnceATurn()}, {}, &fit);
  EXPECT_EQ(fit.model.terms.size(), 1u);
  const Templates ripple = {OfOrder(order)};
  const ScorePass pass = ScoreTemplates(fit, ripple);
  return Assess(pass.scores[0], ripple[0], GroupsOf(facts)).chi_square;
}

// A wave once a turn is bent: the third order is in it at a tenth of its size.
Campaign Bent() {
  Campaign campaign = Planted({}, {.units = 24, .moves = 100, .seed = 21});
  TurnTheta(
      [&](std::size_t row) {
        const double once = 0.3 * std::sin(Turn(campaign, row) + 0.5);
        return once + 0.6 * once * std::abs(once);
      },
      &campaign);
  return campaign;
}

TEST(Discrepancy, WhatAShapeLeavesIsNoEvidenceForAnother) {
  const Campaign campaign = Bent();
  const double alone = Explains(campaign, 3, false), beside = Explains(campaign, 3, true);
  EXPECT_GT(alone, 100);
  EXPECT_LT(beside, 0.15 * alone);
}

TEST(Discrepancy, AWeakCauseBesideAStrongOneKeepsItsEvidence) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 100, .seed = 21});
  TurnTheta(
      [&](std::size_t row) {
        return 0.5 * std::sin(Turn(campaign, row) + 0.5) +
               0.05 * std::sin(2 * Turn(campaign, row) - 1);
      },
      &campaign);
  EXPECT_GT(Explains(campaign, 2, true), 0.8 * Explains(campaign, 2, false));
}

// Distortions cost what their prior asks for: a shape that fits pays next to nothing.
TEST(Discrepancy, CostsLittleWhereTheShapeIsRight) {
  const auto gain = [](const Campaign& campaign) {
    const CampaignFacts facts = MakeFacts(campaign);
    Fit plain = StaticFit(facts);
    Select({OnceATurn()}, {}, &plain);
    Fit bare = plain;
    LeaveOutDiscrepancies(&bare);
    FitAnew(&bare);
    return NegativeBic(plain) - NegativeBic(bare);
  };
  Campaign exact = Planted({}, {.units = 24, .moves = 100, .seed = 21});
  TurnTheta([&](std::size_t row) { return 0.3 * std::sin(Turn(exact, row) + 0.5); }, &exact);
  EXPECT_GT(gain(exact), -60);
  EXPECT_LT(gain(exact), 20);
  EXPECT_GT(gain(Bent()), 60);
}

TEST(Discrepancy, IsOfTheTermsThatTheFitHas) {
  const Campaign campaign = Bent();
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  Select({OnceATurn()}, {}, &fit);
  ASSERT_EQ(fit.model.discrepancies.size(), 1u);
  EXPECT_FALSE(fit.model.discrepancies[0].distortions.empty());
  EXPECT_FALSE(RenewDiscrepancies(&fit));
  fit.model.terms.clear();
  UpdateResiduals(&fit);
  EXPECT_TRUE(fit.model.discrepancies.empty());
}

// The stop's angle in one unit is twice the angle by which the torque turns them all.
TEST(Discrepancy, WhatIsLargerThanTheStrongOneIsNotWhatItsShapeLeaves) {
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
