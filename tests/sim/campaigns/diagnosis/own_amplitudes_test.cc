// Amplitudes of the units' own, held together by a prior: their price, their mean, and their size.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string_view>

#include "sim/campaigns/diagnosis/search/multi_start.h"
#include "sim/campaigns/diagnosis/search/select.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::Verdicts;

// The fit with a term of the first template of the cause that acts on this axis.
Fit WithTerm(const CampaignFacts& facts, std::string_view cause, EffectAxis axis,
             const Evidence& evidence) {
  Fit fit = StaticFit(facts);
  for (const Template& form : ListTemplates(*FindEffect(cause), facts)) {
    if (form.axis != axis) continue;
    fit.model.terms.push_back(MakeTerm(form, evidence, GroupsOf(facts)));
    break;
  }
  StepFit(&fit);
  SettleFit(&fit, 3);
  return fit;
}

TEST(OwnAmplitudes, UnitsThatAreAlikeCostHardlyMoreThanOneAmplitude) {
  constexpr double kPlay_deg = 0.05;
  const Campaign campaign =
      Planted({{"backlash", kPlay_deg, "theta"}}, {.units = 60, .moves = 24, .seed = 3});
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<char> all(campaign.units.size(), 1);
  const Fit one =
      WithTerm(facts, "backlash", EffectAxis::kTheta, {.sharing = Sharing::kFleet, .has = all});
  const Fit each =
      WithTerm(facts, "backlash", EffectAxis::kTheta,
               {.sharing = Sharing::kUnit, .has = all, .spread = 0.0005, .scattered = true});
  // BIC with the rows of all units would ask 480 for the sixty amplitudes.
  EXPECT_LT(std::abs(BetterBy(one, each)), 10);
  const ModelTerm& term = each.model.terms[0];
  EXPECT_NEAR(term.mean, kPlay_deg, 4 * term.mean_sigma);
  EXPECT_NEAR(Summarise(term).value, term.mean, 1e-12);
  EXPECT_NEAR(Summarise(term).sigma, Summarise(one.model.terms[0]).sigma,
              0.5 * Summarise(one.model.terms[0]).sigma);
}

// The spread of the units is not that of a mean that begins at zero: the mean is fitted with them.
TEST(OwnAmplitudes, TheMeanIsNotDrawnToZeroByTheSpread) {
  const Campaign campaign =
      Planted({{"backlash", 0.2, "theta", 1, 0.1}}, {.units = 40, .moves = 30, .seed = 4});
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<char> all(campaign.units.size(), 1);
  const Fit fit =
      WithTerm(facts, "backlash", EffectAxis::kTheta,
               {.sharing = Sharing::kUnit, .has = all, .spread = 0.007, .scattered = true});
  EXPECT_NEAR(fit.model.terms[0].mean, 0.2, 0.01);
}

// A sine and a cosine with errors of their own are together longer than the truth.
TEST(OwnAmplitudes, ErrorsDoNotLengthenAWaveOfTwoColumns) {
  const Campaign campaign =
      Planted({{"eccentricity", 0.02, "theta"}}, {.units = 200, .moves = 24, .seed = 5});
  const CampaignFacts facts = MakeFacts(campaign);
  const std::vector<char> all(campaign.units.size(), 1);
  const Fit fit = WithTerm(facts, "eccentricity", EffectAxis::kTheta,
                           {.sharing = Sharing::kUnit, .has = all, .spread = 0.03});
  double length = 0;
  for (std::size_t unit = 0; unit < all.size(); ++unit)
    length += std::hypot(fit.model.terms[0].AmplitudeOf(unit)[0],
                         fit.model.terms[0].AmplitudeOf(unit)[1]) /
              static_cast<double>(all.size());
  EXPECT_GT(length, 0.023);
  EXPECT_NEAR(Summarise(fit.model.terms[0]).value, 0.02, 0.002);
}

// Many rows know an amplitude better than anybody knows the shape.
TEST(OwnAmplitudes, AnIntervalCountsInThatAShapeIsRoughlyRight) {
  const Diagnosis diagnosis = Verdicts(
      Planted({{"eccentricity", 0.3, "theta"}}, {.units = 40, .moves = 60, .noise_um = 1}));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  const CauseFound& cause = diagnosis.causes[0];
  const double half_width = (cause.ci95[1] - cause.ci95[0]) / 2;
  EXPECT_NEAR(half_width, 1.96 * 0.08 * cause.amplitude, 0.1 * half_width);
}

}  // namespace
}  // namespace focalfleet::sim
