// The state in which a campaign left its units. The state is their counts after the last move, and
// the errors that had added up on each axis by then. A model predicts from there without the
// campaign's moves.
#pragma once

#include <array>
#include <vector>

#include "sim/campaigns/campaign/campaign.h"
#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

struct UnitLeft {
  bool moved = false;  // it has rows; else the rest is not known
  std::array<double, 2> pose_deg{};
  /// The sum of errors that stay until the unit is homed: open-loop effects, slips, the zero of its
  /// last homing.
  std::array<double, 2> added_deg{};
};

/// The state of each unit, without effects that read covariates. Shape: (units).
std::vector<UnitLeft> LeftByCampaign(const CampaignModel& model, const Campaign& campaign);

}  // namespace focalfleet::sim
