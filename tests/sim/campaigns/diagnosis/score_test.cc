// Scores of templates are sums over units, without the part that the model's shared terms explain.
#include "sim/campaigns/diagnosis/score/score.h"

#include <numeric>

#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;

Template Of(const char* cause, const CampaignFacts& facts) {
  return ListTemplates(*FindEffect(cause), facts).front();
}

ModelTerm OfTheFleet(const Template& form, std::size_t units) {
  Evidence evidence;
  evidence.sharing = Sharing::kFleet;
  evidence.has.assign(units, 1);
  return MakeTerm(form, evidence, {});
}

TEST(Score, WhatTheModelHasAlreadySaysNothingNew) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1}});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  const Template form = Of("backlash", facts);
  ASSERT_GT(ScoreTemplates(fit, {form}).scores[0].fleet_g(0, 0), 0);
  for (const char* cause : {"friction_windup", "eccentricity", "gear_scale", "backlash"})
    fit.model.terms.push_back(OfTheFleet(Of(cause, facts), campaign.units.size()));
  StepFit(&fit);
  const ScorePass pass = ScoreTemplates(fit, {form});
  EXPECT_EQ(pass.scores[0].fleet_g(0, 0), 0);
  EXPECT_EQ(pass.scores[0].fleet_b[0], 0);
}

// An amplitude below 0 is no stiction of that unit; its part of the fleet's sum stays.
TEST(Score, AUnitWithAnImpossibleAmplitudeCountsForTheFleet) {
  const Campaign campaign =
      Planted({{.cause = "gear_scale", .amplitude = 0.01, .axis = "theta", .unit_share = 0.2}});
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  Templates templates = ListTemplates(*FindEffect("stiction"), facts);
  const ScorePass pass = ScoreTemplates(fit, templates);
  std::size_t impossible = 0;
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const Score& score = pass.scores[k];
    for (std::size_t unit = 0; unit < score.b.size(); ++unit)
      if (score.g[unit] > 0 && score.b[unit] / score.g[unit] < -3 / std::sqrt(score.g[unit]))
        ++impossible;
    const double sum = std::accumulate(score.b.begin(), score.b.end(), 0.0);
    EXPECT_NEAR(score.fleet_b[0], sum, 1e-9 * std::abs(sum) + 1e-9);
  }
  EXPECT_GT(impossible, 10u);
}

// Chunks of units sum the exposures that they saw, each in its place among those of the campaign.
TEST(Score, ExposuresOfOneUnitSumUpToThatUnit) {
  Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1}});
  std::iota(campaign.move_id.begin(), campaign.move_id.end(), 1);  // no two units share one
  const CampaignFacts facts = MakeFacts(campaign);
  const Fit fit = StaticFit(facts);
  for (const char* cause : {"friction_windup", "eccentricity"}) {
    const Template form = Of(cause, facts);
    const std::size_t c = form.columns;
    const Score score = ScoreTemplates(fit, {form}).scores[0];
    ASSERT_EQ(score.exposure_b.size(), facts.exposures.size() * c);
    for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
      double b = 0, g = 0;
      for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
        b += score.exposure_b[facts.exposures.of_row[row] * c];
        g += score.exposure_g[facts.exposures.of_row[row] * c * c];
      }
      EXPECT_NEAR(b, score.b[unit * c], 1e-9 * (1 + std::abs(b))) << cause;
      EXPECT_NEAR(g, score.g[unit * c * c], 1e-9 * (1 + g)) << cause;
    }
  }
}

// Signatures made once for several looks give the same as those made for each look alone.
TEST(Score, LooksTogetherAreWhatTheyAreAlone) {
  const Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.1}});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  fit.model.terms.push_back(OfTheFleet(Of("backlash", facts), campaign.units.size()));
  ModelTerm own = OfTheFleet(Of("eccentricity", facts), campaign.units.size());
  own.sharing = Sharing::kUnit;
  std::iota(own.group_of_unit.begin(), own.group_of_unit.end(), 0u);
  own.group_of_unit[3] = kNoGroup;
  own.amplitude.assign(campaign.units.size() * own.form.columns, 0);
  own.sigma = own.amplitude;
  fit.model.terms.push_back(own);
  StepFit(&fit);
  Templates templates = ListTemplates(*FindEffect("friction_windup"), facts);
  for (const char* cause : {"axis_tilt", "camera_distortion", "tooth_damage"})
    for (const Template& form : ListTemplates(*FindEffect(cause), facts)) templates.push_back(form);
  const std::size_t withouts[] = {0, kNoTerm, 1};
  const std::vector<ScorePass> together = ScoreWithouts(fit, templates, withouts);
  for (std::size_t l = 0; l < 3; ++l) {
    const ScorePass alone = ScoreTemplates(fit, templates, withouts[l]);
    EXPECT_EQ(together[l].target_square, alone.target_square);
    for (std::size_t k = 0; k < templates.size(); ++k) {
      EXPECT_EQ(together[l].scores[k].b, alone.scores[k].b);
      EXPECT_EQ(together[l].scores[k].target_b, alone.scores[k].target_b);
      EXPECT_EQ(together[l].scores[k].exposure_g, alone.scores[k].exposure_g);
      EXPECT_EQ(together[l].scores[k].fleet_b, alone.scores[k].fleet_b);
      EXPECT_EQ(together[l].scores[k].spread_sum, alone.scores[k].spread_sum);
    }
  }
}

}  // namespace
}  // namespace focalfleet::sim
