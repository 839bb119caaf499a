// A wrong name that other terms have polished, against who it is.
#include "sim/diagnosis/polished.h"

#include <gmock/gmock.h>

#include "sim/effects/registry.h"
#include "tests/sim/diagnosis/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::Not;

ModelTerm OfAllUnits(const char* cause, EffectAxis axis, std::size_t columns, std::size_t units) {
  ModelTerm term;
  term.form = {.effect = FindEffect(cause), .axis = axis, .columns = columns};
  term.sharing = Sharing::kFleet;
  term.group_of_unit.assign(units, 0);
  term.amplitude.assign(columns, 0);
  term.sigma.assign(columns, 0);
  return term;
}

// A scale error fitted by an eccentricity and a tilt.
TEST(Polished, WithoutItsRemaindersWhoIsNearComesForward) {
  const Campaign campaign = Planted({{.cause = "gear_scale", .amplitude = 0.004, .axis = "theta"}},
                                    {.moves = 80, .seed = 5});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  for (const char* cause : {"eccentricity", "axis_tilt"})
    fit.model.terms.push_back(OfAllUnits(cause, EffectAxis::kTheta, 2, campaign.units.size()));
  StepFit(&fit);
  SettleFit(&fit, 2);
  Templates library;
  for (const char* cause : {"eccentricity", "axis_tilt", "gear_scale", "gravity_sag"})
    for (Template& form : ListTemplates(*FindEffect(cause), facts))
      library.push_back(std::move(form));
  std::vector<CauseFound> causes = {CauseNamed("eccentricity")};
  causes[0].axis = "theta";
  AskWithoutRemainders(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("eccentricity"));  // nobody said it has any
  causes[0].remainders = {"axis_tilt"};
  AskWithoutRemainders(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates, Contains("gear_scale"));
  EXPECT_THAT(causes[0].candidates, Not(Contains("gravity_sag")));
  // Of another axis.
  causes[0] = CauseNamed("eccentricity");
  causes[0].axis = "phi", causes[0].remainders = {"axis_tilt"};
  AskWithoutRemainders(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("eccentricity"));
}

}  // namespace
}  // namespace focalfleet::sim
