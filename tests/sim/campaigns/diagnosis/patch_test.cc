// Empirical terms for structure that is planted outside the library.
#include "sim/campaigns/diagnosis/use/patch.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/campaigns/effects/empirical.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Damp;
using test::Planted;
using test::Reported;
using test::TurnTheta;
using test::Verdicts;

// A ripple of order five, 0.05 degrees, with a phase of each unit's own.
Campaign FiveTimesATurn() {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 12});
  std::vector<double> phase(campaign.rows());
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      phase[row] = 0.7 * static_cast<double>(unit) +
                   5 * campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180;
  TurnTheta([&](std::size_t row) { return 0.05 * std::sin(phase[row]); }, &campaign);
  return campaign;
}

std::vector<const ModelTerm*> EmpiricalTerms(const Diagnosis& diagnosis) {
  std::vector<const ModelTerm*> terms;
  for (const ModelTerm& term : diagnosis.model.terms)
    if (FindEmpirical(term.form.effect->cause) != nullptr) terms.push_back(&term);
  return terms;
}

TEST(Patch, AnAngleThatFollowsTheHumidityIsCorrectedAndNotNamed) {
  const Campaign campaign = Damp(11);
  const Diagnosis plain = Diagnose(campaign, {});
  const Diagnosis patched = Diagnose(campaign, {.patch = true});
  ASSERT_EQ(plain.verdict, Verdict::kUnknown) << Reported(plain);
  ASSERT_FALSE(plain.unknown.empty()) << Reported(plain);
  EXPECT_EQ(plain.unknown[0].covariate, "humidity_pct");
  EXPECT_FALSE(plain.unknown[0].patched);
  EXPECT_TRUE(EmpiricalTerms(plain).empty());

  EXPECT_EQ(patched.verdict, Verdict::kUnknown) << Reported(patched);
  ASSERT_FALSE(patched.unknown.empty());
  EXPECT_EQ(patched.unknown[0].covariate, "humidity_pct");
  ASSERT_TRUE(patched.unknown[0].patched);
  EXPECT_EQ(patched.unknown[0].patched->term, "empirical_curve");
  // The planted curve is 0.12 degrees times a square of 0 to 1, about its mean, at some 11 mm from
  // the base.
  EXPECT_NEAR(patched.unknown[0].patched->size_um, 7, 2.5);
  EXPECT_EQ(patched.causes.size(), plain.causes.size()) << Reported(patched);
  ASSERT_EQ(EmpiricalTerms(patched).size(), 1u);
  EXPECT_EQ(EmpiricalTerms(patched)[0]->form.columns, kEmpiricalCosines);
  EXPECT_EQ(ChannelOf(EmpiricalTerms(patched)[0]->form), "theta angle");
  EXPECT_LT(patched.gain.rms_after_um, 1.08 * patched.gain.noise_floor_um);
  EXPECT_GT(plain.gain.rms_after_um, 1.3 * patched.gain.rms_after_um);
}

TEST(Patch, ARippleOfNoGearIsCorrectedAndNotNamed) {
  const Campaign campaign = FiveTimesATurn();
  const Diagnosis plain = Diagnose(campaign, {});
  const Diagnosis patched = Diagnose(campaign, {.patch = true});
  ASSERT_EQ(plain.verdict, Verdict::kUnknown) << Reported(plain);
  EXPECT_EQ(patched.verdict, Verdict::kUnknown) << Reported(patched);
  ASSERT_EQ(EmpiricalTerms(patched).size(), 1u);
  const ModelTerm& term = *EmpiricalTerms(patched)[0];
  EXPECT_EQ(term.form.effect, &EmpiricalRipple());
  EXPECT_EQ(term.form.shape, 5);
  EXPECT_NEAR(Summarise(term).value, 0.05, 0.005);
  EXPECT_EQ(patched.unknown[0].patched->term, "empirical_ripple");
  EXPECT_LT(patched.gain.rms_after_um, 1.1 * patched.gain.noise_floor_um);
  EXPECT_GT(plain.gain.rms_after_um, 1.3 * patched.gain.rms_after_um);
}

TEST(Patch, AnImageThatFollowsTheWindGetsCurvesInsteadOfShifts) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = 8});
  const Exposures exposures = FindExposures(campaign);
  Rng rng = Rng::Stream(3, "wind");
  std::vector<double> wind(exposures.size());
  for (double& w : wind) w = rng.Uniform(0, 12);
  Covariate column{.name = "wind_m_s", .values = {}};
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    column.values.push_back(wind[exposures.of_row[row]]);
    campaign.x_mm[row] += 1e-3 * column.values.back();
  }
  campaign.covariates.push_back(std::move(column));
  const Diagnosis diagnosis = Verdicts(campaign, {.patch = true});
  EXPECT_EQ(diagnosis.verdict, Verdict::kUnknown);
  ASSERT_FALSE(diagnosis.unknown.empty()) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.unknown[0].covariate, "wind_m_s");
  ASSERT_TRUE(diagnosis.unknown[0].patched);
  EXPECT_NEAR(diagnosis.unknown[0].patched->size_um, 12 / std::sqrt(12.0), 1);
  EXPECT_TRUE(diagnosis.model.exposures.empty());
}

TEST(Patch, WhereNothingIsUnknownNothingIsPatched) {
  const Diagnosis diagnosis =
      Verdicts(Planted({{.cause = "backlash", .amplitude = 0.04}}), {.patch = true});
  EXPECT_TRUE(EmpiricalTerms(diagnosis).empty()) << Reported(diagnosis);
  EXPECT_TRUE(diagnosis.unknown.empty()) << Reported(diagnosis);
}

TEST(Patch, IsBoundedWhereStructureDoesNotEnd) {
  Campaign campaign = FiveTimesATurn();
  for (const double order : {7.3, 9.1, 12.7, 20.4})
    TurnTheta(
        [&](std::size_t row) {
          return 0.06 * std::sin(order * campaign.cmd_deg[kTheta][row] * std::numbers::pi / 180);
        },
        &campaign);
  const Diagnosis diagnosis = Verdicts(campaign, {.patch = true});
  EXPECT_LE(EmpiricalTerms(diagnosis).size(), kPatchTermsMax);
  EXPECT_GE(EmpiricalTerms(diagnosis).size(), 2u);
}

}  // namespace
}  // namespace focalfleet::sim
