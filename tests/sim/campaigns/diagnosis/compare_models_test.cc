#include "sim/campaigns/diagnosis/use/compare_models.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Verdicts;

CampaignModel Nominal(const Campaign& campaign) {
  CampaignModel model;
  model.units = campaign.units;
  return model;
}

// Gears that turn by a share more than in the table.
Campaign Geared(double share, std::uint64_t seed) {
  return Planted({{.cause = "gear_scale", .amplitude = share}},
                 {.units = 24, .moves = 80, .seed = seed});
}

ModelComparison Compared(const CampaignModel& a, const CampaignModel& b, const Campaign& campaign) {
  return CompareModels({&a, &b}, campaign, {});
}

TEST(CompareModels, AModelAgainstItselfDiffersByNothing) {
  const Campaign campaign = Geared(3e-4, 3);
  const CampaignModel model = Nominal(campaign);
  const ModelComparison result = Compared(model, model, campaign);
  EXPECT_EQ(result.rows, campaign.rows());
  EXPECT_EQ(result.difference_um, 0);
  EXPECT_EQ(result.ci95_um[0], 0);
  EXPECT_EQ(result.ci95_um[1], 0);
  EXPECT_EQ(result.preference, Preference::kNone);
  for (const GeometryDifference& one : DifferenceOf({&model, &model}).geometry)
    EXPECT_EQ(one.rms, 0) << one.what;
}

TEST(CompareModels, WhatWasFittedToAnEffectBeatsTheIdealOnOtherMoves) {
  const CampaignModel fitted = Verdicts(Geared(3e-4, 3)).model;
  const Campaign other = Geared(3e-4, 4);
  const CampaignModel ideal = Nominal(other);
  const ModelComparison result = Compared(ideal, fitted, other);
  EXPECT_EQ(result.preference, Preference::kB);
  EXPECT_LT(result.ci95_um[1], 0);
  EXPECT_LT(result.ci95_um[0], result.difference_um);
  EXPECT_GT(result.ci95_um[1], result.difference_um);
  EXPECT_NEAR(result.difference_um, result.b.rms_um - result.a.rms_um, 1e-9);
  EXPECT_LT(result.b.rms_um, 0.8 * result.a.rms_um);
  EXPECT_LT(result.b.mad_um, result.a.mad_um);
  const ModelDifference difference = DifferenceOf({&ideal, &fitted});
  ASSERT_EQ(difference.terms.size(), 1u);
  EXPECT_EQ(difference.terms[0].cause, "gear_scale");
  EXPECT_FALSE(difference.terms[0].a);
  ASSERT_TRUE(difference.terms[0].b);
  EXPECT_NEAR(difference.terms[0].b->amplitude.value, 3e-4, 3e-5);
  EXPECT_TRUE(std::isnan(difference.terms[0].sigmas));
}

TEST(CompareModels, ExchangingTheModelsChangesSignsAlone) {
  const Campaign campaign = Geared(1e-5, 5);
  const CampaignModel a = Nominal(campaign);
  CampaignModel b = a;
  for (CampaignUnit& unit : b.units) unit.zero_deg[kTheta] += 0.02;
  const ModelComparison one = Compared(a, b, campaign), other = Compared(b, a, campaign);
  EXPECT_NE(one.difference_um, 0);
  EXPECT_EQ(one.difference_um, -other.difference_um);
  EXPECT_EQ(one.ci95_um[0], -other.ci95_um[1]);
  EXPECT_EQ(one.ci95_um[1], -other.ci95_um[0]);
  EXPECT_EQ(one.a.rms_um, other.b.rms_um);
  EXPECT_EQ(one.preference, Preference::kA);
  EXPECT_EQ(other.preference, Preference::kB);
}

TEST(CompareModels, AFleetThatHasDriftedIsFound) {
  const Campaign today = Geared(5e-4, 4);
  const CampaignModel then = Verdicts(Geared(3e-4, 3)).model, now = Verdicts(today).model;
  EXPECT_EQ(Compared(then, now, today).preference, Preference::kB);
  const ModelDifference difference = DifferenceOf({&then, &now});
  ASSERT_EQ(difference.terms.size(), 1u);
  const TermDifference& gear = difference.terms[0];
  EXPECT_EQ(gear.cause, "gear_scale");
  ASSERT_TRUE(gear.a && gear.b);
  EXPECT_NEAR(gear.b->amplitude.value - gear.a->amplitude.value, 2e-4, 3e-5);
  EXPECT_GT(gear.sigmas, 5);
  EXPECT_EQ(gear.a->units, 24u);
}

// Both models are equally far from the truth on either side, so that chance decides which is
// better.
TEST(CompareModels, NoiseSeldomPrefersAModel) {
  int preferred = 0;
  constexpr std::uint64_t kCampaigns = 60;
  for (std::uint64_t seed = 1; seed <= kCampaigns; ++seed) {
    const Campaign campaign = Planted({}, {.units = 8, .moves = 40, .seed = 100 + seed});
    CampaignModel a = Nominal(campaign), b = a;
    for (CampaignUnit& unit : a.units) unit.base_x_mm += 0.003;
    for (CampaignUnit& unit : b.units) unit.base_x_mm -= 0.003;
    if (Compared(a, b, campaign).preference != Preference::kNone) ++preferred;
  }
  // The expected number of 60 at 5 % is 3; the axes' rest errors last longer than an exposure and
  // add a few.
  EXPECT_LE(preferred, 10);
}

TEST(CompareModels, WhatBothMissByFarIsLeftOutAndCounted) {
  const Campaign campaign =
      Planted({}, {.units = 24, .moves = 80, .seed = 6, .outlier_share = 0.01, .lost_share = 0.02});
  const CampaignModel ideal = Nominal(campaign);
  CampaignModel off = ideal;  // far off in one exposure, by this model alone: its rows stay
  off.exposures.assign(80, {});
  off.exposures[7].shift_x_um = 200;
  const ModelComparison result = Compared(ideal, off, campaign);
  std::size_t left_out = 0;
  for (const auto& [why, rows] : result.left_out) left_out += rows;
  EXPECT_EQ(result.rows + left_out, campaign.rows());
  EXPECT_GT(result.left_out.at("not seen"), 20u);
  EXPECT_GT(result.left_out.at("far off by both models"), 10u);
  EXPECT_LT(result.left_out.at("far off by both models"), 30u);
  EXPECT_LT(result.a.rms_um, 8);  // that of the outliers is above 100
  EXPECT_GT(result.b.rms_um, 15);
  EXPECT_EQ(result.preference, Preference::kNone) << "by a single exposure";
}

TEST(CompareModels, AUnitThatStandsElsewhereIsLeftOutWhole) {
  Campaign campaign = Planted({});
  for (std::size_t row = campaign.first_row[7]; row < campaign.first_row[8]; ++row)
    campaign.x_mm[row] += 3;
  const CampaignModel ideal = Nominal(campaign);
  const ModelComparison result = Compared(ideal, ideal, campaign);
  EXPECT_EQ(result.left_out.at("unit stands elsewhere by both models"), 60u);
  EXPECT_LT(result.a.rms_um, 8);
}

TEST(CompareModels, FewExposuresShowNoDifference) {
  const Campaign campaign = Planted({}, {.units = 24, .moves = kExposuresForPreference - 1});
  CampaignModel a = Nominal(campaign), b = a;
  for (CampaignUnit& unit : b.units) unit.base_x_mm += 0.1;
  const ModelComparison result = Compared(a, b, campaign);
  EXPECT_GT(result.ci95_um[0], 0);
  EXPECT_EQ(result.preference, Preference::kNone);
}

TEST(CompareModels, ATermWhoseColumnIsMissingIsLeftOutByName) {
  Campaign campaign =
      Planted({{.cause = "gravity_sag", .amplitude = 20}}, {.units = 24, .seed = 3});
  const CampaignModel fitted = Verdicts(campaign).model;
  ASSERT_EQ(fitted.terms.size(), 1u);
  std::erase_if(campaign.covariates, [](const Covariate& c) { return c.name == "elevation_deg"; });
  const ModelComparison result = Compared(Nominal(campaign), fitted, campaign);
  ASSERT_EQ(result.b.left_out.size(), 1u);
  EXPECT_EQ(result.b.left_out[0].cause, "gravity_sag");
  EXPECT_EQ(result.b.left_out[0].why, "column elevation_deg is missing");
  EXPECT_TRUE(result.a.left_out.empty());
}

TEST(DifferenceOf, CountsZerosAroundTheTurnAndNamesTheUnit) {
  const Campaign campaign = Planted({});
  CampaignModel a = Nominal(campaign), b = a;
  a.units[3].zero_deg[kPhi] = 179.99;
  b.units[3].zero_deg[kPhi] = -179.99;
  b.units[9].base_x_mm += 0.003;
  b.units[9].base_y_mm += 0.004;
  const ModelDifference difference = DifferenceOf({&a, &b});
  const auto find = [&](const std::string& what) {
    return *std::find_if(difference.geometry.begin(), difference.geometry.end(),
                         [&](const GeometryDifference& one) { return one.what == what; });
  };
  EXPECT_NEAR(find("phi zero").largest, 0.02, 1e-9);
  EXPECT_EQ(find("phi zero").largest_unit, campaign.units[3].id);
  EXPECT_NEAR(find("phi zero").rms, 0.02 / std::sqrt(24.0), 1e-9);
  EXPECT_NEAR(find("base").largest, 5, 1e-6);
  EXPECT_EQ(find("base").largest_unit, campaign.units[9].id);
  EXPECT_EQ(find("theta arm").rms, 0);
}

}  // namespace
}  // namespace focalfleet::sim
