// The page /metrics as text. docs/metrics.md lists every family with its unit and meaning.
//
// The number of series does not grow with the number of units: no label names a unit. Each bus has
// 13 series, each rail 3, and the rest has some 160 together.
#pragma once

#include <cstdint>
#include <string>

#include "daemon/metrics/fleet_metrics.h"
#include "daemon/metrics/process_facts.h"
#include "daemon/metrics/work_counters.h"

namespace focalfleet {

std::string MetricsText(const FleetMetrics& fleet, const WorkCounters& work,
                        const ProcessFacts& process, std::uint64_t store_bytes);

}  // namespace focalfleet
