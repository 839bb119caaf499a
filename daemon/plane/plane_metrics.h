// The page /metrics of a plane's coordinator: the plane as a whole, from what its sectors report
// and publish. Names begin with focalfleet_plane_, so that sums over the sectors' own pages do not
// count a unit twice. docs/metrics.md lists every family.
//
// Series: some 70, and 6 for each sector.
#pragma once

#include <string>

#include "daemon/metrics/process_facts.h"
#include "daemon/plane/plane_requests.h"

namespace focalfleet {

/// Pre: `plane` has a table.
std::string PlaneMetricsText(const PlaneInstant& plane, const ProcessFacts& process);

}  // namespace focalfleet
