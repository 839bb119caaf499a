// A wrong name that other terms have polished is compared with the right one.
#include "sim/campaigns/diagnosis/polished.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "sim/campaigns/effects/registry.h"
#include "tests/sim/campaigns/planting/planted_campaign.h"

namespace focalfleet::sim {
namespace {

using test::Planted;
using test::StaticFit;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::Field;
using testing::Ne;
using testing::Not;

// Theta's first form of a cause, one amplitude for all units.
ModelTerm OfAllUnits(const char* cause, const CampaignFacts& facts) {
  const Templates forms = ListTemplates(*FindEffect(cause), facts);
  ModelTerm term;
  term.form = *std::ranges::find(forms, EffectAxis::kTheta, &Template::axis);
  term.sharing = Sharing::kFleet;
  term.group_of_unit.assign(facts.campaign->units.size(), 0);
  term.amplitude.assign(term.form.columns, 0);
  term.sigma.assign(term.form.columns, 0);
  return term;
}

// A scale error fitted by an eccentricity and a fibre's torque.
TEST(Polished, WithoutItsMisfitArtefactsWhoIsNearComesForward) {
  const Campaign campaign = Planted({{.cause = "gear_scale", .amplitude = 0.004, .axis = "theta"}},
                                    {.units = 24, .moves = 80, .seed = 5});
  const CampaignFacts facts = MakeFacts(campaign);
  Fit fit = StaticFit(facts);
  for (const char* cause : {"eccentricity", "fibre_torque"})
    fit.model.terms.push_back(OfAllUnits(cause, facts));
  StepFit(&fit);
  SettleFit(&fit, 2);
  Templates library;
  for (const char* cause : {"eccentricity", "fibre_torque", "gear_scale", "gravity_sag"})
    for (Template& form : ListTemplates(*FindEffect(cause), facts))
      library.push_back(std::move(form));
  EXPECT_THAT(FindRivals(library, {}, fit, 0),
              Each(Field(&Rival::cause, Ne("gear_scale"))));  // with the terms that polish the name
  std::vector<CauseFound> causes = {CauseNamed("eccentricity")};
  causes[0].axis = "theta";
  ReassessWithoutMisfitArtefacts(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates,
              ElementsAre("eccentricity"));  // without reported misfit artefacts
  causes[0].misfit_artefacts = {"fibre_torque"};
  ReassessWithoutMisfitArtefacts(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates, Contains("gear_scale"));
  EXPECT_THAT(causes[0].candidates, Not(Contains("gravity_sag")));
  // A misfit artefact of another axis.
  causes[0] = CauseNamed("eccentricity");
  causes[0].axis = "phi", causes[0].misfit_artefacts = {"fibre_torque"};
  ReassessWithoutMisfitArtefacts(library, {}, fit, &causes);
  EXPECT_THAT(causes[0].candidates, ElementsAre("eccentricity"));
}

}  // namespace
}  // namespace focalfleet::sim
