// How a campaign left its units: where their counts stood after the last move, and what had added
// up on each axis by then. From there on a model predicts without the campaign's moves.
#pragma once

#include <array>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/diagnosis/model.h"

namespace focalfleet::sim {

struct UnitLeft {
  bool moved = false;  // it has rows; else nothing of the rest is known
  std::array<double, 2> pose_deg{};
  /// Of what adds up until the unit is homed: open-loop effects, slips, the zero of its last
  /// homing.
  std::array<double, 2> added_deg{};
};

/// Shape: (units). Effects that read covariates are not in it.
std::vector<UnitLeft> LeftByCampaign(const CampaignModel& model, const Campaign& campaign);

}  // namespace focalfleet::sim
