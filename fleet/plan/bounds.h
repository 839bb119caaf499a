// What no plan can be better than: the time of the slowest straight way, and the energy of all
// straight ways over the limits of power.
#pragma once

#include "fleet/plan/power_ledger.h"
#include "fleet/plan/service.h"

namespace focalfleet {

/// Of those that are served, each alone and straight. Units: s.
double TimeBoundS(const Service& service);

/// No plan within the limits is shorter than the energy of straight moves over the limit. Units: s.
double PowerBoundS(const Service& service, const PowerLimits& limits, PowerLedger* ledger);

/// A limit below what one motor draws lets nobody move; one that takes longer than offsets can say
/// leaves some no time. Errors: kRefused, with the least limit that would do.
Status CheckPower(const Service& service, const PlanOptions& options);

}  // namespace focalfleet
