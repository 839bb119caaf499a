// A unit's geometry by its places alone: no effects, no noise, a minority of rows anywhere.
#pragma once

#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// Where a fibre was seen at the angles that its axes should stand at.
struct PlainRow {
  double theta_deg, phi_deg, x_mm, y_mm;
};

/// The geometry that most of the rows agree on, from `start`; what they do not show stays where the
/// table has it. `rounds`: at most.
CampaignUnit FitPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table,
                      CampaignUnit start, int rounds);

/// The same with zeros anywhere. Below four rows: the table's.
CampaignUnit FindPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table);

}  // namespace focalfleet::sim
