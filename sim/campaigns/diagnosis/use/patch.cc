#include "sim/campaigns/diagnosis/use/patch.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "sim/campaigns/diagnosis/check/screen.h"
#include "sim/campaigns/diagnosis/model/term_trace.h"
#include "sim/campaigns/diagnosis/search/select.h"
#include "sim/campaigns/diagnosis/terms/image.h"
#include "sim/campaigns/diagnosis/terms/image_followed.h"
#include "sim/campaigns/effects/empirical.h"

namespace focalfleet::sim {
namespace {

constexpr double kSizeMinUm = 0.05;  // a smaller misfit is not worth a term, however certain
// The spread of units' own amplitudes, where nothing else determines them.
constexpr double kSpreadMaxDeg = 0.3;

bool IsSame(const Template& a, const Template& b) {
  constexpr double kNearOrders = 0.3;  // orders that are nearer are one ripple, found again
  return a.effect == b.effect && a.axis == b.axis && a.form == b.form &&
         a.covariate == b.covariate &&
         (a.effect == &EmpiricalCurve() || std::abs(a.shape - b.shape) < kNearOrders);
}

// The term that shows the structure, with amplitudes for all of its curve.
ModelTerm PatchOf(const ModelTerm& look, const CampaignFacts& facts) {
  ModelTerm term = look;
  if (look.form.effect == &EmpiricalCurve()) {
    term.form = WholeCurve(look.form, facts);
  } else {
    char order[48];
    std::snprintf(order, sizeof order, "ripple of order %.4g", look.form.shape);
    term.form.label = order;
  }
  term.amplitude.assign(look.groups() * term.form.columns, 0);
  term.sigma.assign(term.amplitude.size(), 0);
  // The rows of a single unit may not separate all cosines.
  if (term.sharing == Sharing::kUnit && !(term.spread > 0)) term.spread = kSpreadMaxDeg;
  return term;
}

void Refit(Fit* fit) {
  StepFit(fit);
  SettleFit(fit, 2);
}

// An error that all units have alike moves the image, too, until it has a term.
void FindImageAnew(const PatchRule& rule, Fit* fit) {
  if (fit->model.exposures.empty()) return;
  fit->model.exposures.clear();
  UpdateResiduals(fit);
  Refit(fit);
  AddImageTerms(fit, rule.family_wise);
}

// Adds the image's shifts as curves over the column that they follow. Other motion stays in the
// image's own terms.
bool PatchImage(const PatchRule& rule, UnknownFound* reported, Fit* fit) {
  const FilledColumn* column = fit->facts->Find(reported->covariate);
  if (column == nullptr || !column->varies()) return false;
  fit->model.exposures.clear();
  for (const int channel : {kPlaceX, kPlaceY}) {
    ModelTerm look;
    look.form = {.effect = &EmpiricalCurve(), .form = channel, .covariate = reported->covariate};
    look.group_of_unit.assign(fit->model.units.size(), 0);
    look.amplitude = {0};
    fit->model.terms.push_back(PatchOf(look, *fit->facts));
  }
  UpdateResiduals(fit);
  Refit(fit);
  AddImageTerms(fit, rule.family_wise);
  // Steps of the image may have been dropped; the curves are the last terms.
  const std::size_t terms = fit->model.terms.size();
  reported->patched = {std::string(EmpiricalCurve().cause),
                       std::hypot(SizeOf(*fit, fit->model.terms[terms - 2]),
                                  SizeOf(*fit, fit->model.terms[terms - 1]))};
  return true;
}

}  // namespace

std::vector<UnknownFound> PatchStructures(const PatchRule& rule,
                                          std::vector<UnknownFound>* reported, Fit* fit) {
  std::size_t added = 0;
  for (UnknownFound& one : *reported)
    if (added == 0 && one.channel.starts_with(kImageShift) && PatchImage(rule, &one, fit))
      added += 2;
  std::vector<UnknownFound> seen;
  while (auto structure = FindStructure(*fit, rule.family_wise, rule.seed)) {
    seen.push_back(structure->reported);
    const bool again =
        std::any_of(fit->model.terms.begin(), fit->model.terms.end(),
                    [&](const ModelTerm& term) { return IsSame(term.form, structure->term.form); });
    if (again || added >= kPatchTermsMax) break;
    const CampaignModel without = fit->model;
    fit->model.terms.push_back(PatchOf(structure->term, *fit->facts));
    Refit(fit);
    const double size_um = SizeOf(*fit, fit->model.terms.back());
    if (size_um < kSizeMinUm) {
      fit->model = without;
      UpdateResiduals(fit);
      SettleFit(fit, 2);
      break;
    }
    seen.back().patched = {std::string(structure->term.form.effect->cause), size_um};
    ++added;
    FindImageAnew(rule, fit);
  }
  return seen;
}

}  // namespace focalfleet::sim
