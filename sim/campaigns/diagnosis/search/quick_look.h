// Some shapes are too many to be scored one by one, such as every step that commands may be rounded
// to. A quick look along the axis' angle alone, without geometry, neighbours or the noise's memory,
// finds those that are worth a score.
#pragma once

#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The few templates of the effects' `glance` that stand out in some unit, or in the sum over the
/// fleet. Their `choices` is the number of templates that were tried.
Templates WorthAScore(const Fit& fit, const Templates& library);

}  // namespace focalfleet::sim
