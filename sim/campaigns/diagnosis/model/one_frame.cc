#include "sim/campaigns/diagnosis/model/one_frame.h"

#include <cmath>
#include <utility>
#include <vector>

#include "sim/campaigns/campaign/place_steps.h"
#include "sim/campaigns/diagnosis/model/plain_geometry.h"

namespace focalfleet::sim {
namespace {

std::vector<PlainRow> RowsOfFirst(const Frames& frames, const Campaign& campaign,
                                  std::size_t unit) {
  std::vector<PlainRow> rows;
  for (std::size_t row = campaign.first_row[unit]; row < campaign.first_row[unit + 1]; ++row)
    if (frames.of_row[row] == 0 && std::isfinite(campaign.x_mm[row]))
      rows.push_back({campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row],
                      campaign.x_mm[row], campaign.y_mm[row]});
  return rows;
}

// The frame whose image is moved least against the table, over the bases of all units.
std::size_t NearestToTable(const std::vector<Similarity>& found, const Campaign& campaign) {
  std::size_t nearest = 0;
  double least = 0;
  for (std::size_t frame = 0; frame < found.size(); ++frame) {
    double square = 0;
    for (const CampaignUnit& unit : campaign.units) {
      const std::complex<double> base(unit.base_x_mm, unit.base_y_mm);
      square += std::norm(found[frame].Of(base) - base);
    }
    if (frame == 0 || square < least) nearest = frame, least = square;
  }
  return nearest;
}

}  // namespace

void BringIntoOneFrame(const ParallelFor& parallel, Campaign* campaign) {
  const Frames frames = FindFrames(*campaign);
  if (frames.of_row.empty()) return;
  CampaignModel by_table, by_first;
  by_table.units = by_first.units = campaign->units;
  const std::vector<UnitChunk> chunks = ChunksOf(campaign->units.size());
  parallel(chunks.size(), [&](std::size_t chunk) {
    for (std::size_t unit = chunks[chunk].begin; unit < chunks[chunk].end; ++unit)
      by_first.units[unit] = FindPlain(RowsOfFirst(frames, *campaign, unit), campaign->units[unit]);
  });
  const CampaignFacts facts = MakeFacts(*campaign);
  Places measured{campaign->x_mm, campaign->y_mm};
  const std::size_t nearest =
      NearestToTable(FitFrames(frames, Predict(by_table, facts, parallel), measured), *campaign);
  const std::vector<Similarity> found =
      FitFrames(frames, Predict(by_first, facts, parallel), measured);
  TakeToOne(frames, found, found[nearest], &measured);
  const PlaceSteps steps = FindPlaceSteps(*campaign);
  campaign->steps_mm = {steps.x_mm, steps.y_mm};
  campaign->x_mm = std::move(measured.x_mm), campaign->y_mm = std::move(measured.y_mm);
}

void AlignByModel(const CampaignModel& model, const CampaignFacts& facts,
                  const ParallelFor& parallel, Campaign* campaign) {
  Places measured{std::move(campaign->x_mm), std::move(campaign->y_mm)};
  const std::vector<Similarity> found =
      FitFrames(facts.frames, Predict(model, facts, parallel), measured);
  TakeToOne(facts.frames, found, found[0], &measured);
  campaign->x_mm = std::move(measured.x_mm), campaign->y_mm = std::move(measured.y_mm);
}

}  // namespace focalfleet::sim
