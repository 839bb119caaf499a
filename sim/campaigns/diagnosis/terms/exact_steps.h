// Some steps of single units are so large that only the exact place shows them. They are whole
// commands lost or made twice, of both axes or of one, or whole turns of the rotor. Where neither
// explains the rows, an obstacle has kept the axes from their way by any angle.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The unit's steps, all of one kind. Empty where its rows are near, or where no kind explains
/// them. Sets the geometry to that of the rows, because a fit without the steps may have been
/// dragged along.
std::vector<EventTerm> ExactSteps(const Fit& fit, std::size_t unit, CampaignUnit* geometry);

}  // namespace focalfleet::sim
