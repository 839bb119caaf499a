// A search on some units, whose model goes to all, names no cause for sure that a search on all
// would not.
#include "sim/campaigns/diagnosis/search/some_units.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;

Templates TemplatesOf(const std::vector<const char*>& causes, const CampaignFacts& facts) {
  Templates templates;
  for (const char* cause : causes)
    for (const Template& form : ListTemplates(*FindEffect(cause), facts)) templates.push_back(form);
  return templates;
}

std::set<std::string> RivalsOf(const Selection& selection) {
  std::set<std::string> names;
  for (const Accepted& one : selection.accepted)
    for (const Rival& rival : one.rivals) names.emplace(rival.cause);
  return names;
}

SelectionRule Halves(const Campaign& campaign) {
  return {.rows_many = campaign.rows() / 2, .rows_kept = campaign.rows() / 2};
}

// The only unit that has play is not among those that are searched first.
TEST(SomeUnits, ACauseOfTheOthersHasItsRivals) {
  Campaign campaign = Planted({}, {.units = 24, .moves = 24, .seed = 3});
  const Campaign with_play = Planted({{.cause = "backlash", .amplitude = 0.15, .axis = "theta"}},
                                     {.units = 24, .moves = 24, .seed = 3});
  std::size_t unit = 0;
  {
    const CampaignFacts facts = MakeFacts(campaign);
    const SelectionRule rule = Halves(campaign);
    const Fit some = SomeUnits(StaticFit(facts), 12, rule.seed);
    while (some.aside[campaign.first_row[unit]] == 0) ++unit;
  }
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
    campaign.x_mm[row] = with_play.x_mm[row], campaign.y_mm[row] = with_play.y_mm[row];
  const CampaignFacts facts = MakeFacts(campaign);
  const Templates library = TemplatesOf({"backlash", "friction_windup", "stiction"}, facts);
  Fit of_all = StaticFit(facts), of_some = StaticFit(facts);
  const std::set<std::string> wanted = RivalsOf(Select(library, {}, &of_all));
  ASSERT_EQ(of_all.model.terms.size(), 1u);
  ASSERT_FALSE(wanted.empty());
  EXPECT_EQ(RivalsOf(Select(library, Halves(campaign), &of_some)), wanted);
  EXPECT_EQ(of_some.model.terms.size(), 1u);
}

// With the same number of movers in each move a droop of both axes looks like play of each.
TEST(SomeUnits, PairsOfCausesStayRivals) {
  Campaign campaign = Planted({{.cause = "backlash", .amplitude = 0.01, .axis = "theta"},
                               {.cause = "backlash", .amplitude = 0.01, .axis = "phi"}},
                              {.units = 24, .moves = 80, .seed = 3});
  std::ranges::fill(
      std::ranges::find(campaign.covariates, "movers_on_rail", &Covariate::name)->values, 12);
  const CampaignFacts facts = MakeFacts(campaign);
  Templates library = TemplatesOf({"backlash", "supply_droop"}, facts);
  Fit of_all = StaticFit(facts), of_some = StaticFit(facts);
  const std::set<std::string> wanted = RivalsOf(Select(library, {}, &of_all));
  ASSERT_TRUE(wanted.contains("backlash")) << testing::PrintToString(wanted);
  EXPECT_EQ(RivalsOf(Select(library, Halves(campaign), &of_some)), wanted);
}

}  // namespace
}  // namespace focalfleet::sim
