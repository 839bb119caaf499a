// Moves of one kind of modulation end elsewhere than those of another.
#include <gmock/gmock.h>

#include <algorithm>

#include "sim/campaigns/diagnosis/use/left_by.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::Reported;
using test::TurnTheta;
using test::Verdicts;

// Every third move runs in five segments, and travels that much too far.
Campaign OfTwoModes(double travel_deg) {
  Campaign campaign = Planted({}, {.units = 12, .moves = 80, .seed = 7});
  WordColumn mode{.name = "mode", .words = {"seven_segment", "five_segment"}, .values = {}};
  std::vector<double> off_deg(campaign.rows(), 0);
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    double sum = 0;
    for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row) {
      mode.values.push_back(row % 3 == 0 ? 1 : 0);
      const double step = campaign.cmd_deg[kTheta][row] - campaign.from_deg[kTheta][row];
      const std::span<const double> rehomed = campaign.Find("rehomed");
      if (!rehomed.empty() && rehomed[row] > 0.5) sum = 0;
      if (mode.values.back() == 1 && step != 0) sum += step > 0 ? travel_deg : -travel_deg;
      off_deg[row] = sum;
    }
  }
  campaign.word_columns.push_back(std::move(mode));
  TurnTheta([&](std::size_t row) { return off_deg[row]; }, &campaign);
  return campaign;
}

TEST(DriveModes, ATravelOfOneModeIsTheModes) {
  const Diagnosis diagnosis = Verdicts(OfTwoModes(0.02));
  ASSERT_EQ(diagnosis.causes.size(), 1u) << Reported(diagnosis);
  EXPECT_EQ(diagnosis.causes[0].cause, "mode_threshold") << Reported(diagnosis);
  EXPECT_THAT(diagnosis.causes[0].shape, testing::HasSubstr("in mode five_segment"));
  EXPECT_NEAR(diagnosis.causes[0].amplitude, 0.02, 0.002);
}

// Commands have no modes: what the moves of one mode have added up is not known where the model is
// used, and the model leaves it out.
TEST(DriveModes, ATermOfOneModeIsNotOfPosesAlone) {
  const Campaign campaign = OfTwoModes(0.02);
  const CampaignModel model = Verdicts(campaign).model;
  ASSERT_EQ(model.terms.size(), 1u);
  EXPECT_EQ(model.terms[0].form.memory, Memory::kChain);
  EXPECT_FALSE(IsOfPosesAlone(model.terms[0].form));
  for (const UnitLeft& left : LeftByCampaign(model, campaign)) EXPECT_EQ(left.added_deg[kTheta], 0);
}

TEST(DriveModes, WithoutADifferenceNothingIsNamed) {
  EXPECT_EQ(Verdicts(OfTwoModes(0)).verdict, Verdict::kConsistent);
}

TEST(DriveModes, TheirColumnHasTheIndicesOfTheModesWhateverOrderTheWordsHave) {
  const Campaign campaign = OfTwoModes(0);
  const CampaignFacts facts = MakeFacts(campaign);
  ASSERT_TRUE(facts.Has(kMode));
  EXPECT_EQ(facts.Find(kMode)->low, 1);   // five_segment
  EXPECT_EQ(facts.Find(kMode)->high, 2);  // seven_segment
}

}  // namespace
}  // namespace focalfleet::sim
