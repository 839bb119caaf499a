// Roundings to steps that no list has.
#include "sim/campaigns/diagnosis/search/quick_look.h"

#include <gmock/gmock.h>

#include <map>

#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::StaticFit;
using test::TurnTheta;
using test::Verdicts;

double Nearest(double steps) { return std::round(steps); }
double TowardsZero(double steps) { return std::trunc(steps); }

// Theta commands of these units rounded, each to a step of its own.
Campaign Rounded(const std::map<std::size_t, double>& step_deg, std::uint64_t seed,
                 double (*whole)(double) = Nearest) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 80, .seed = seed});
  std::vector<double> step_of_row(campaign.rows(), 0);
  for (const auto& [unit, step] : step_deg)
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
      step_of_row[row] = step;
  TurnTheta(
      [&](std::size_t row) {
        const double commanded = campaign.cmd_deg[kTheta][row], step = step_of_row[row];
        return step == 0 ? 0 : whole(commanded / step) * step - commanded;
      },
      &campaign);
  return campaign;
}

Templates Worth(const Campaign& campaign) {
  const CampaignFacts facts = MakeFacts(campaign);
  return WorthAScore(StaticFit(facts), ListTemplates(*FindEffect("command_quantisation"), facts));
}

TEST(QuickLook, SeesAStepThatIsNotListed) {
  const Templates worth = Worth(Rounded({{7, 0.37}}, 3));
  ASSERT_FALSE(worth.empty());
  EXPECT_EQ(worth[0].axis, EffectAxis::kTheta);
  EXPECT_DOUBLE_EQ(worth[0].shape, 0.37);
  EXPECT_GT(worth[0].choices, 400);
}

TEST(QuickLook, SeesAStepOfAllUnitsThatIsTooSmallInEach) {
  std::map<std::size_t, double> all;
  for (std::size_t unit = 0; unit < 24; ++unit) all[unit] = 0.03;
  const Templates worth = Worth(Rounded(all, 5));
  ASSERT_FALSE(worth.empty());
  EXPECT_DOUBLE_EQ(worth[0].shape, 0.03);
}

TEST(QuickLook, SeesAnyStepOfAllUnitsByItsPeriod) {
  constexpr double kStep_deg = 0.2194580153;
  std::map<std::size_t, double> all;
  for (std::size_t unit = 0; unit < 24; ++unit) all[unit] = kStep_deg;
  const Campaign campaign = Rounded(all, 5);
  const Templates worth = Worth(campaign);
  ASSERT_FALSE(worth.empty());
  EXPECT_NEAR(worth[0].shape, kStep_deg, 1e-5);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "command_quantisation");
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
}

TEST(QuickLook, SeesAnyStepThatIsCutTowardsZero) {
  std::map<std::size_t, double> all;
  for (std::size_t unit = 0; unit < 24; ++unit) all[unit] = 0.2194580153;
  const Campaign campaign = Rounded(all, 5, TowardsZero);
  ASSERT_LT(std::ranges::min(campaign.cmd_deg[kTheta]), 0) << "cutting is not rounding down";
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "command_quantisation");
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
}

// Each move of a unit is cut to whole steps, and what is cut off adds up. Few moves show that each
// loses half a step on average, but not the step.
TEST(QuickLook, CutMovesMayBeCutToAnyStep) {
  constexpr double kStep_deg = 0.0383;
  for (const std::uint64_t seed : {4u, 5u, 6u}) {
    Campaign campaign = Planted({}, {.units = 24, .moves = 60, .seed = seed});
    std::vector<double> behind(campaign.rows(), 0);
    for (std::size_t row = campaign.first_row[4]; row < campaign.first_row[5]; ++row) {
      const double step = campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row];
      behind[row] = behind[row - 1] + std::trunc(step / kStep_deg) * kStep_deg - step;
    }
    TurnTheta([&](std::size_t row) { return behind[row]; }, &campaign);
    const Diagnosis diagnosis = Verdicts(campaign);
    ASSERT_FALSE(diagnosis.causes.empty()) << "seed " << seed;
    EXPECT_THAT(diagnosis.causes[0].candidates, testing::Contains("command_quantisation"))
        << "seed " << seed << ": " << Reported(diagnosis);
  }
}

TEST(QuickLook, SeesLittleInNoise) {
  std::size_t seen = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) seen += Worth(Rounded({}, seed)).size();
  EXPECT_LE(seen, 2u);
}

class StepsOfUnitsOwn : public testing::TestWithParam<std::map<std::size_t, double>> {};

TEST_P(StepsOfUnitsOwn, AreOneCause) {
  const std::map<std::size_t, double>& steps = GetParam();
  const Campaign campaign = Rounded(steps, 6);
  const Diagnosis diagnosis = Verdicts(campaign);
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.verdict, Verdict::kExplained) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "command_quantisation");
  ASSERT_EQ(diagnosis.model.terms.size(), 1u);
  const ModelTerm& term = diagnosis.model.terms[0];
  std::vector<std::uint32_t> rounded;
  for (const auto& [unit, step] : steps) {
    rounded.push_back(campaign.units[unit].id);
    const double shape = term.form.shape_of_unit.at(campaign.units[unit].id);
    EXPECT_NEAR(shape < 5 ? shape : 360 / std::exp2(shape), step, 1e-9);  // degrees, or bits
  }
  EXPECT_EQ(diagnosis.causes[0].units, rounded);
}

using Steps = std::map<std::size_t, double>;
INSTANTIATE_TEST_SUITE_P(
    QuickLook, StepsOfUnitsOwn,
    testing::Values(Steps{{2, 0.31}, {9, 0.37}, {17, 0.53}},
                    Steps{{2, 360.0 / 256}, {9, 360.0 / 512}, {17, 360.0 / 1024}}));

}  // namespace
}  // namespace focalfleet::sim
