// Steps of single units so large that only the exact place tells: whole commands that were lost or
// made twice, of both axes or of one; whole turns of the rotor; and, where neither explains the
// rows, whatever the axes were kept from by something in their way.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/fit.h"

namespace focalfleet::sim {

/// The unit's steps, all of one kind; none: its rows lie near, or no kind explains them. Its
/// geometry is set to the one that they belong to, as a fit that did not know of them may have been
/// dragged along.
std::vector<EventTerm> ExactSteps(const Fit& fit, std::size_t unit, CampaignUnit* geometry);

}  // namespace focalfleet::sim
