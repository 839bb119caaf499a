// Slips are steps of an axis by whole turns of its rotor, against the motion, that stay until the
// unit is homed. Each is a hypothesis with a fixed size, so that its likelihood ratio needs no fit
// of an amplitude: chance reaches a ratio of e^L with probability e^-L at most. A slip is taken
// where the ratio is larger than the number of slips that there could have been, by the family-wise
// rate. The narrowest window of rows that shows a slip tells it, with the unit's geometry free in
// the window.
// Source: Ville's inequality, as in Royall, Statistical Evidence, chapter 1.
#pragma once

#include <vector>

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The unit's slips, as the residuals show them. `family_wise`: the rate at which any unit of the
/// campaign has a slip by chance.
std::vector<EventTerm> FindSlips(const Fit& fit, std::size_t unit, double family_wise);

/// ln of the likelihood ratio of each step of the model, beside all other terms. Shape: (events).
std::vector<double> LogLikelihoodOfEvents(const Fit& fit);

}  // namespace focalfleet::sim
