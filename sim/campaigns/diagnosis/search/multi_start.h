// Selection begins from several starts, because a single one may be misleading. The starts are with
// and without steps of single units, and with zeros that differ from homing to homing.
#pragma once

#include "sim/campaigns/diagnosis/search/select.h"

namespace focalfleet::sim {

/// Takes the start whose fit has the largest -BIC; a start that claims more must be clearly better.
/// Afterwards the model's homing_zero_deg are empty where zeros are the same after each homing.
Selection SelectMultiStart(const Templates& templates, const SelectionRule& rule, Fit* fit);

/// The -BIC by which the fit is better than the other, by one noise for both. Factors of units and
/// exposures wander by more than a step is worth. Each noise favours the fit that it comes from, so
/// that the result is the mean of the two.
double BetterBy(const Fit& fit, const Fit& than);

}  // namespace focalfleet::sim
