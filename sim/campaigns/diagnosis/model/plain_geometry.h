// Plain geometry is a unit's geometry by its places alone, without effects or noise; a minority of
// rows may be anywhere.
#pragma once

#include <vector>

#include "sim/campaigns/campaign/campaign.h"

namespace focalfleet::sim {

/// The place of a fibre that was seen, and the angles that its axes should have.
struct PlainRow {
  double theta_deg, phi_deg, x_mm, y_mm;
};

/// The geometry that most of the rows agree on, from `start`; what they do not show stays as in the
/// table. `rounds`: at most.
CampaignUnit FitPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table,
                      CampaignUnit start, int rounds);

/// The same with zeros anywhere. Below four rows: the table's.
CampaignUnit FindPlain(const std::vector<PlainRow>& rows, const CampaignUnit& table);

/// The units with the geometry by which the coordinator turned places into angles, where loops were
/// closed. Each move began at angles that it inferred from the place before, so that no effect has
/// a part in them. A unit for which too few moves tell it, or whose moves agree on none, stays as
/// it is.
std::vector<CampaignUnit> FindCoordinatorsGeometry(const Campaign& campaign);

}  // namespace focalfleet::sim
