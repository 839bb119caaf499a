// A measured configuration has served only the units that are known to be within the tolerance, by
// an exposure after their last motion. All others end as failed (beyond it), unmeasured, or
// stopped.
#pragma once

#include "fleet/coordinate/configuration.h"
#include "fleet/coordinate/coordination.h"
#include "fleet/coordinate/corrections.h"

namespace focalfleet {

/// Takes back the arrival of every unit that was to be measured and is not known to be within the
/// tolerance. A configuration that is only observed needs the exposure alone. No effect on a
/// configuration that is not measured.
void JudgeMeasured(const Coordination& fleet, const Corrections& corrections,
                   Configuration* configuration);
/// Judges the units of a measurement without motion: arrived where they were found.
void JudgeFound(const Coordination& fleet, Configuration* configuration);

}  // namespace focalfleet
