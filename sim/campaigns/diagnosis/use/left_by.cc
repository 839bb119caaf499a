#include "sim/campaigns/diagnosis/use/left_by.h"

#include "sim/campaigns/effects/pose_track.h"

namespace focalfleet::sim {
namespace {

UnitLeft LeftBy(const CampaignModel& model, const Campaign& campaign, std::size_t unit) {
  const std::size_t end = campaign.first_row[unit + 1];
  std::size_t begin = campaign.first_row[unit];
  if (begin == end) return {};
  // A loop that was closed begins anew where the camera saw the fibre.
  for (const std::string_view anew : {"rehomed", "from_measured"}) {
    const std::span<const double> column = campaign.Find(anew);
    for (std::size_t row = begin; row < end && !column.empty(); ++row)
      if (column[row] > 0.5) begin = row;
  }
  UnitLeft left{.moved = true};
  PoseTrack track(model.units[unit],
                  {campaign.from_deg[kTheta][begin], campaign.from_deg[kPhi][begin]});
  for (std::size_t row = begin; row < end; ++row)
    track.Go({campaign.from_deg[kTheta][row], campaign.from_deg[kPhi][row]},
             {campaign.cmd_deg[kTheta][row], campaign.cmd_deg[kPhi][row]});
  left.pose_deg = {campaign.cmd_deg[kTheta][end - 1], campaign.cmd_deg[kPhi][end - 1]};
  PoseErrors errors;
  errors.Reset(track.moves());
  for (const ModelTerm& term : model.terms) {
    const std::span<const double> amplitude = term.AmplitudeOf(unit);
    if (amplitude.empty() || term.form.memory != Memory::kChain || !IsOfPosesAlone(term.form))
      continue;
    term.form.effect->apply(track.track(), term.form, amplitude, &errors);
  }
  for (const std::size_t axis : {kTheta, kPhi}) {
    left.added_deg[axis] = errors.angle_deg[axis].back();
    if (!model.homing_zero_deg[axis].empty())
      left.added_deg[axis] += model.homing_zero_deg[axis][end - 1];
  }
  for (const EventTerm& event : model.events)
    if (event.unit == unit && event.stays && event.row >= begin)
      left.added_deg[event.axis] += event.step_deg;
  return left;
}

}  // namespace

std::vector<UnitLeft> LeftByCampaign(const CampaignModel& model, const Campaign& campaign) {
  std::vector<UnitLeft> left;
  for (std::size_t unit = 0; unit < campaign.units.size(); ++unit)
    left.push_back(LeftBy(model, campaign, unit));
  return left;
}

}  // namespace focalfleet::sim
