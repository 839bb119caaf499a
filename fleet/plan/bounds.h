// Lower bounds of every plan: the time of the slowest straight way, and the energy of all straight
// ways over the limits of power.
#pragma once

#include "fleet/plan/power_ledger.h"
#include "fleet/plan/service.h"

namespace focalfleet {

/// The longest time of a served unit that moves alone and straight. Units: s.
double TimeBoundS(const Service& service);

/// No plan within the limits is shorter than the energy of straight moves over the limit. Units: s.
double PowerBoundS(const Service& service, const PowerLimits& limits, PowerLedger* ledger);

/// A limit below what one motor draws lets no unit move. A limit whose plan takes longer than
/// offsets can say leaves some units no time. Errors: kRefused, with the least limit that would do.
Status CheckPower(const Service& service, const PlanOptions& options);

}  // namespace focalfleet
