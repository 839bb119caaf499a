#include "sim/campaigns/diagnosis/polished.h"

#include <algorithm>
#include <span>

#include "sim/campaigns/diagnosis/families.h"
#include "sim/campaigns/diagnosis/term_trace.h"

namespace focalfleet::sim {
namespace {

bool IsNamed(const ModelTerm& term, std::string_view cause, std::string_view axis) {
  return term.form.effect->cause == cause && AxesMeet(Name(term.form.axis), axis);
}

// A separate cause of the same name is no misfit artefact.
bool IsMisfitArtefact(const ModelTerm& term, const CauseFound& of,
                      std::span<const CauseFound> named) {
  return std::ranges::any_of(
             of.misfit_artefacts,
             [&](const std::string& name) { return IsNamed(term, name, of.axis); }) &&
         std::ranges::none_of(named, [&](const CauseFound& cause) {
           return IsNamed(term, cause.cause, cause.axis);
         });
}

// The largest part of a cause that has several terms; kNoTerm: none is left.
std::size_t StrongestOf(const Fit& fit, const CauseFound& cause) {
  std::size_t strongest = kNoTerm;
  double most_um = 0;
  for (std::size_t t = 0; t < fit.model.terms.size(); ++t) {
    if (!IsNamed(fit.model.terms[t], cause.cause, cause.axis)) continue;
    const double size_um = SizeOf(fit, fit.model.terms[t]);
    if (strongest == kNoTerm || size_um > most_um) strongest = t, most_um = size_um;
  }
  return strongest;
}

}  // namespace

void ReassessWithoutMisfitArtefacts(const Templates& templates, const SelectionRule& rule,
                                    const Fit& fit, std::vector<CauseFound>* causes) {
  for (CauseFound& cause : *causes) {
    Fit bare = fit;
    if (std::erase_if(bare.model.terms, [&](const ModelTerm& term) {
          return IsMisfitArtefact(term, cause, *causes);
        }) == 0)
      continue;
    FitAnew(&bare);
    const std::size_t strongest = StrongestOf(bare, cause);
    if (strongest == kNoTerm) continue;
    for (const Rival& rival : FindRivals(templates, rule, bare, strongest))
      if (std::ranges::find(cause.candidates, rival.cause) == cause.candidates.end())
        cause.candidates.emplace_back(rival.cause);
  }
}

}  // namespace focalfleet::sim
