// Fine structure varies faster than any curve of the screen can follow. Examples are roundings,
// teeth of an unknown order, effects of small steps and fractions of a pixel. Two methods find it
// without a shape for it.
//
// Near repeats: noise differs each time, an effect repeats. Residuals of pairs of rows with nearly
// one value of a column are multiplied. The products' mean is zero by chance, whatever the noise of
// each. Pairs are of different exposures, because the common part of an exposure is no repeat.
// Source: the ratio of J. von Neumann, Ann. Math. Statist. 12 (1941) 367, with pairs chosen by
// distance.
//
// Fine ripple: the periodogram of an axis' residuals over its angle where it has just moved, of all
// units at one phase. The fast Fourier transform makes it.
// Source: A. Schuster, Terr. Magn. 3 (1898) 13.
#pragma once

#include <optional>

#include "sim/campaigns/diagnosis/decide/diagnosis.h"
#include "sim/campaigns/diagnosis/model/fit.h"

namespace focalfleet::sim {

/// The clearest structure. The result is nullopt where chance explains it, at a share of the
/// family-wise rate. A structure is also ignored below `share_min` of the variance along an angle
/// or direction.
std::optional<UnknownFound> FindFineStructure(const Fit& fit, double family_wise,
                                              double share_min = 0.08);

}  // namespace focalfleet::sim
