#include "sim/campaigns/diagnosis/search/some_units.h"

#include <limits>
#include <numeric>
#include <utility>

#include "protocol/base/rng.h"
#include "sim/campaigns/diagnosis/score/score.h"
#include "sim/campaigns/diagnosis/search/candidate_shapes.h"
#include "sim/campaigns/diagnosis/search/quick_look.h"

namespace focalfleet::sim {

Fit SomeUnits(const Fit& fit, std::size_t keep, std::uint64_t seed) {
  Fit some = fit;
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<std::size_t> order(campaign.units.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  Rng rng = Rng::Stream(seed, "some units");
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[rng.Below(k)]);
  for (std::size_t k = keep; k < order.size(); ++k)
    for (std::size_t row = campaign.first_row[order[k]]; row < campaign.first_row[order[k] + 1];
         ++row)
      some.aside[row] = 1;
  UpdateWeights(&some);
  SettleFit(&some, 2);
  return some;
}

void SpreadToAll(const Fit& some, ModelTerm* term) {
  if (term->sharing != Sharing::kUnit) return;
  const Campaign& campaign = *some.facts->campaign;
  std::size_t seen = 0, have = 0;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t row = campaign.first_row[unit];
    if (row == campaign.first_row[unit + 1] || some.aside[row] != 0) continue;
    ++seen;
    if (term->group_of_unit[unit] != kNoGroup) ++have;
  }
  if (2 * have <= seen) return;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit) {
    const std::size_t row = campaign.first_row[unit];
    if (row == campaign.first_row[unit + 1] || some.aside[row] != 0)
      term->group_of_unit[unit] = static_cast<std::uint32_t>(unit);
  }
}

void GiveShapes(const Templates& library, const FleetGroups& groups, std::size_t t, Fit* fit) {
  const auto at = fit->model.terms.begin() + static_cast<std::ptrdiff_t>(t);
  ModelTerm term = std::move(*at);
  fit->model.terms.erase(at);
  UpdateResiduals(fit);
  Templates kind = KindOf(term.form, library);
  for (Template& more : KindOf(term.form, WorthAScore(*fit, library)))
    kind.push_back(std::move(more));
  constexpr double kAny = -std::numeric_limits<double>::infinity();
  std::vector<CandidateShape> found =
      OwnShapes(ScoreTemplates(*fit, kind), kind, *fit->facts, groups, kAny);
  RefineCandidateShapes(*fit, groups, &found);
  // Shapes of the examined units stay.
  for (CandidateShape& one : found) term.form.shape_of_unit.merge(one.form.shape_of_unit);
  for (std::size_t unit = 0; unit < term.group_of_unit.size(); ++unit)
    if (!ShapeOf(term.form, fit->model.units[unit].id)) term.group_of_unit[unit] = kNoGroup;
  fit->model.terms.insert(fit->model.terms.begin() + static_cast<std::ptrdiff_t>(t),
                          std::move(term));
  UpdateResiduals(fit);
}

}  // namespace focalfleet::sim
