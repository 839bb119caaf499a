// Faults of a unit that answers wrongly, late, too often or not at all: how a site plants one, and
// how the simulated unit counts what such a fault has changed.
#pragma once

#include <optional>

#include "daemon/soak/fault_sites.h"
#include "protocol/base/ids.h"
#include "protocol/base/rng.h"
#include "sim/world/faults.h"

namespace focalfleet::soak {

/// Plants the fault; nothing at a site that is no such.
void LetAnswerWrongly(FaultSite site, UnitId unit, Rng* rng, sim::UnitFaults* faults);

/// None: the site is no such.
std::optional<sim::UnitFaults::Kind> KindOf(FaultSite site);

}  // namespace focalfleet::soak
