// MOONS and robots like its own. Layout: a parameter file of the VLT (PAF),
// `INS.POS14.RFOCAL 43.7;`, with what all positioners share in INS.POS and acquisition cameras in
// INS.ACQ. Targets: lines without a header, `14 44.66 191.62 L 1`: positioner, R, THETA, parity,
// priority; or the seven numbers of the assignment. docs/observatories.md has the keys.
//
//   x = R sin THETA, y = R cos THETA: THETA is clockwise from the y axis
//   theta_zero = ORIENT; phi_zero = 180: at beta 0 the arm is folded back
#pragma once

#include "daemon/observatory/plate.h"

namespace focalfleet::observatory {

Result<Plate> ReadMoons(const SourceFiles& files);

/// R and THETA (degrees) of a place.
std::pair<double, double> PolarOf(PointFp place);

}  // namespace focalfleet::observatory
