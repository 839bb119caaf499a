#include "sim/diagnosis/polished.h"

#include <algorithm>

#include "sim/diagnosis/families.h"

namespace focalfleet::sim {
namespace {

bool IsNamed(const ModelTerm& term, std::string_view cause, std::string_view axis) {
  return term.form.effect->cause == cause && AxesMeet(Name(term.form.axis), axis);
}

bool IsRemainder(const ModelTerm& term, const CauseFound& of) {
  return std::ranges::any_of(
      of.remainders, [&](const std::string& name) { return IsNamed(term, name, of.axis); });
}

}  // namespace

void AskWithoutRemainders(const Templates& templates, const SelectionRule& rule, const Fit& fit,
                          std::vector<CauseFound>* causes) {
  constexpr int kRounds = 2;
  for (CauseFound& cause : *causes) {
    Fit bare = fit;
    if (std::erase_if(bare.model.terms,
                      [&](const ModelTerm& term) { return IsRemainder(term, cause); }) == 0)
      continue;
    UpdateResiduals(&bare);
    StepFit(&bare);
    SettleFit(&bare, kRounds);
    for (std::size_t t = 0; t < bare.model.terms.size(); ++t) {
      if (!IsNamed(bare.model.terms[t], cause.cause, cause.axis)) continue;
      for (const Rival& rival : FindRivals(templates, rule, bare, t))
        if (!rival.behind_by_likelihood &&
            std::ranges::find(cause.candidates, rival.cause) == cause.candidates.end())
          cause.candidates.emplace_back(rival.cause);
    }
  }
}

}  // namespace focalfleet::sim
