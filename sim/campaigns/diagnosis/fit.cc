#include "sim/campaigns/diagnosis/fit.h"

#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/plain_geometry.h"

namespace focalfleet::sim {
namespace {

std::vector<PlainRow> PlainRows(const Fit& fit, std::size_t unit) {
  const Campaign& campaign = *fit.facts->campaign;
  std::vector<PlainRow> rows;
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
    if (fit.aside[row] == 0 && std::isfinite(campaign.x_mm[row]))
      rows.push_back({campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row],
                      campaign.x_mm[row], campaign.y_mm[row]});
  return rows;
}

}  // namespace

void UpdateResiduals(Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  const Places places = Predict(fit->model, *fit->facts, fit->parallel);
  fit->x_um.resize(campaign.rows());
  fit->y_um.resize(campaign.rows());
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    fit->x_um[row] = (campaign.x_mm[row] - places.x_mm[row]) * kUmPerMm;
    fit->y_um[row] = (campaign.y_mm[row] - places.y_mm[row]) * kUmPerMm;
  }
}

Fit StartFit(const CampaignFacts& facts, CampaignModel model, std::vector<char> aside,
             ParallelFor parallel) {
  Fit fit;
  fit.facts = &facts;
  fit.model = std::move(model);
  fit.aside = std::move(aside);
  fit.parallel = std::move(parallel);
  fit.noise.least_um = LeastNoise_um(*facts.campaign, FindPlaceSteps(*facts.campaign));
  fit.noise.unit_factor.assign(fit.model.units.size(), 1);
  std::vector<CampaignUnit> first = fit.model.units;
  const std::vector<UnitChunk> chunks = ChunksOf(first.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      first[unit] = FindPlain(PlainRows(fit, unit), fit.model.units[unit]);
  });
  fit.model.units = std::move(first);
  fit.weight.assign(facts.campaign->rows(), 1);
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.aside[row] != 0 || !std::isfinite(facts.campaign->x_mm[row])) fit.weight[row] = 0;
  UpdateResiduals(&fit);
  SettleFit(&fit, 3);
  return fit;
}

}  // namespace focalfleet::sim
