#include "sim/campaigns/diagnosis/model/fit.h"

#include <cmath>

#include "protocol/base/units.h"
#include "sim/campaigns/diagnosis/model/chances.h"
#include "sim/campaigns/diagnosis/model/discrepancy.h"
#include "sim/campaigns/diagnosis/model/far_angles.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"

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
  DropStaleDiscrepancies(fit);
  const Campaign& campaign = *fit->facts->campaign;
  const Places places = Predict(fit->model, *fit->facts, fit->parallel);
  fit->x_um.resize(campaign.rows());
  fit->y_um.resize(campaign.rows());
  for (std::size_t row = 0; row < campaign.rows(); ++row) {
    fit->x_um[row] = (campaign.x_mm[row] - places.x_mm[row]) * kUmPerMm;
    fit->y_um[row] = (campaign.y_mm[row] - places.y_mm[row]) * kUmPerMm;
  }
  if (!fit->model.large_errors) return;
  for (std::size_t unit = 0; unit < fit->model.units.size(); ++unit) {
    const UnitTrack track = TrackOf(fit->model, *fit->facts, unit);
    PoseErrors errors;
    errors.Reset(track.moves);
    AddPoseErrors(fit->model, unit, track, &errors);
    for (const std::size_t axis : {kTheta, kPhi})
      for (std::size_t i = 0; i < track.moves; ++i)
        errors.angle_deg[axis][i] += track.cmd_deg[axis][i];
    TakeFarAngles(track, errors.angle_deg[kTheta], errors.angle_deg[kPhi], &fit->x_um, &fit->y_um);
  }
}

namespace {

constexpr double kFar_um = 1000;  // of half of the rows: no straight line describes the errors

void TakeRows(Fit* fit) {
  const Campaign& campaign = *fit->facts->campaign;
  fit->weight.assign(campaign.rows(), 1);
  for (std::size_t row = 0; row < fit->weight.size(); ++row)
    if (fit->aside[row] != 0 || !std::isfinite(campaign.x_mm[row])) fit->weight[row] = 0;
  UpdateResiduals(fit);
}

// Errors that are large in a way that no geometry explains leave the table's as it is.
void StartNearTable(GeometryIs where, Fit* fit) {
  fit->geometry_is = where;
  fit->model.large_errors = true;
  fit->noise.fitted = false;
  TakeRows(fit);
  SettleFit(fit, 3);
}

}  // namespace

double MedianMiss_um(const Fit& fit) {
  std::vector<double> misses;
  for (std::size_t row = 0; row < fit.weight.size(); ++row)
    if (fit.weight[row] > 0) misses.push_back(std::hypot(fit.x_um[row], fit.y_um[row]));
  return misses.empty() ? 0 : Median(std::move(misses));
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
  if (const std::size_t frames = facts.frames.size(); frames > 1 && frames <= kFramesOfFitMax)
    fit.model.frames.assign(frames, FrameTerm{});
  if (!facts.closed.empty()) {
    StartNearTable(GeometryIs::kKnown, &fit);
    return fit;
  }
  const std::vector<CampaignUnit> table = fit.model.units;
  std::vector<CampaignUnit> first = fit.model.units;
  const std::vector<UnitChunk> chunks = ChunksOf(first.size());
  fit.parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      first[unit] = FindPlain(PlainRows(fit, unit), fit.model.units[unit]);
  });
  fit.model.units = std::move(first);
  TakeRows(&fit);
  SettleFit(&fit, 3);
  if (MedianMiss_um(fit) > kFar_um) {
    fit.model.units = table;
    StartNearTable(GeometryIs::kNearTable, &fit);
  }
  return fit;
}

}  // namespace focalfleet::sim
