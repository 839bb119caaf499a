// SDSS-V and robots like its own. Layout: positionerTable and wokCoords of fps_calibrations, joined
// by holeID (also as tables of a proc-fimg file). State: alpha and beta of a confSummary or
// POSANGLES. Targets: FIBERMAP of a confSummary. Moves: POSANGLES and POSITIONERTABLEMEAS of
// proc-fimg files, one file an exposure. docs/observatories.md has the columns.
//
//   theta is alpha, phi is beta; the arm ends at the metrology fibre
//   theta_zero = alphaOffset + direction of (ix, iy), phi_zero = betaOffset + atan2(metY, metX)
//   base = xWok + dx, yWok + dy; arms alphaArmLen and hypot(metX, metY)
#pragma once

#include "daemon/observatory/plate.h"

namespace focalfleet::observatory {

Result<Plate> ReadSdss(const SourceFiles& files);

}  // namespace focalfleet::observatory
