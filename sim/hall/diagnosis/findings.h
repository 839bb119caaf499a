// The findings that follow from the selected causes. They are causes with sizes and intervals,
// structure that remains, the gain on poses that no fit has seen, and the poses to make next.
#pragma once

#include "sim/hall/diagnosis/hall_diagnosis.h"
#include "sim/hall/diagnosis/selection.h"

namespace focalfleet::sim {

void AddFindings(const HallForward& forward, const HallCampaign& campaign, const HallSearch& search,
                 const Selected& selected, HallDiagnosis* out);

/// Structure in the residuals of the selected model, against poses, order and temperature.
std::vector<HallUnknown> RemainingStructure(const HallForward& forward,
                                            const HallCampaign& campaign, const HallSearch& search,
                                            const Selected& selected);

/// 24 poses within 12 deg of tilt. Cost: some ten ms.
std::vector<Orientation> ProposePoses(const HallForward& forward, const Eigen::VectorXd& parameters,
                                      const std::vector<Reading>& readings, double noise_V);

}  // namespace focalfleet::sim
