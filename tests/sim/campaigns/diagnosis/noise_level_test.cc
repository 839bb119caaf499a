// Chance by what the templates that explain nothing take up of the noise.
#include <gtest/gtest.h>

#include <cmath>
#include <string_view>

#include "sim/campaigns/diagnosis/score/evidence.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;

Templates WholeLibrary(const CampaignFacts& facts) {
  Templates templates;
  for (const Effect& effect : EffectLibrary())
    if (MissingCovariate(effect, facts).empty())
      for (Template& form : ListTemplates(effect, facts))
        if (Shows(facts, form)) templates.push_back(std::move(form));
  return templates;
}

TEST(NoiseLevel, IsLowerWhereTheNoiseIsTakenTooLarge) {
  constexpr double kTooLarge = 1.25;
  const Campaign campaign = Planted({}, {.units = 120, .moves = 24, .seed = 11});
  const CampaignFacts facts = MakeFacts(campaign);
  const Templates templates = WholeLibrary(facts);
  Fit fit = StaticFit(facts);
  const NoiseLevel fitted = LevelOf(ScoreTemplates(fit, templates).scores, templates, fit.parallel);
  EXPECT_NEAR(fitted.mean, 1, 0.08);
  for (double& factor : fit.noise.unit_factor) factor *= kTooLarge;
  const NoiseLevel large = LevelOf(ScoreTemplates(fit, templates).scores, templates, fit.parallel);
  EXPECT_NEAR(large.mean / fitted.mean, 1 / (kTooLarge * kTooLarge), 0.02);
}

// Each unit shows next to nothing. All of them together show it clearly.
TEST(NoiseLevel, LetsManyUnitsSpeakTogether) {
  constexpr double kSure = 1e-6;
  const Campaign campaign =
      Planted({{"eccentricity", 0.02, "theta"}}, {.units = 1000, .moves = 12, .seed = 12});
  const CampaignFacts facts = MakeFacts(campaign);
  const Templates templates = WholeLibrary(facts);
  const Fit fit = StaticFit(facts);
  const ScorePass pass = ScoreTemplates(fit, templates);
  const NoiseLevel noise = LevelOf(pass.scores, templates, fit.parallel);
  std::string_view clearest;
  double least = 0;
  for (std::size_t k = 0; k < templates.size(); ++k) {
    const double log_p = Assess(pass.scores[k], templates[k], GroupsOf(facts), noise).log_p;
    if (log_p < least) least = log_p, clearest = templates[k].effect->cause;
  }
  EXPECT_EQ(clearest, "eccentricity");
  EXPECT_LT(least, std::log(kSure));
}

// Geometry absorbs more of the noise in some moves than in others, and nearly all of it in few.
TEST(Noise, IsAsLargeAsPlantedWhereMovesAreFew) {
  constexpr double kNoise_um = 3, kRest_deg = 0.01;
  const Campaign campaign = Planted(
      {},
      {.units = 600, .moves = 12, .seed = 13, .noise_um = kNoise_um, .rest_noise_deg = kRest_deg});
  const CampaignFacts facts = MakeFacts(campaign);
  const Noise noise = StaticFit(facts).noise;
  EXPECT_NEAR(std::hypot(noise.place_um, noise.rest_um), kNoise_um, 0.05 * kNoise_um);
  for (const std::size_t axis : {kTheta, kPhi})
    EXPECT_NEAR(std::hypot(noise.rest_deg[axis], noise.angle_deg[axis]), kRest_deg,
                0.3 * kRest_deg);
  for (const double factor : noise.exposure_factor) EXPECT_NEAR(factor, 1, 0.1);
}

}  // namespace
}  // namespace focalfleet::sim
