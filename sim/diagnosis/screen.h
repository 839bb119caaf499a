// Is there structure left that no effect of the library explains? The residual is looked at along
// each axis' angle and each direction of the plate, with and without the direction of motion,
// against every column of the table (smooth curves over its ranks) and against ripples of any
// order of either axis. The looks are templates like those of effects, so that they are scored,
// shared and gated the same way; what they find is called empirical, never a cause.
#pragma once

#include "sim/effects/effect.h"

namespace focalfleet::sim {

Templates ScreenTemplates(const CampaignFacts& facts);

/// Where the look sees it: "theta angle", "x" ...
std::string ChannelOf(const Template& look);

}  // namespace focalfleet::sim
