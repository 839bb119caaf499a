// Selection from several beginnings, where one may lead astray: with and without steps of single
// units, and with zeros that differ from homing to homing.
#pragma once

#include "sim/campaigns/diagnosis/select.h"

namespace focalfleet::sim {

/// The beginning with the most NegativeBic decides; beginnings that claim more must be clearly
/// better. Post: the model's homing_zero_deg are empty where zeros are the same after each homing.
Selection SelectMultiStart(const Templates& templates, const SelectionRule& rule, Fit* fit);

/// How much NegativeBic the fit has more, by one noise for both: factors of units and exposures
/// wander by more than a step is worth. Each noise favours the fit that it comes from, so that it
/// is the mean of the two.
double BetterBy(const Fit& fit, const Fit& than);

}  // namespace focalfleet::sim
