// A campaign whose camera was moved between frames (campaign/frames.h), as if it had stood still.
#pragma once

#include "sim/campaigns/diagnosis/model/model.h"

namespace focalfleet::sim {

/// Takes the measured places to the frame that is nearest to the table's geometry. The places that
/// are expected in the other frames are those of each unit's geometry by the frame with most rows
/// alone, so that zeros need not be known. A unit with too few rows there has the table's geometry.
void BringIntoOneFrame(const ParallelFor& parallel, Campaign* campaign);

/// The same by the places of a model, to the frame with most rows. Pre: the campaign is that of the
/// facts, and has more than one frame.
void AlignByModel(const CampaignModel& model, const CampaignFacts& facts,
                  const ParallelFor& parallel, Campaign* campaign);

}  // namespace focalfleet::sim
