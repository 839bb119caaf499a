// DESI and robots like its own. Layout: rows of the calibration of positioners (posmovedb,
// fpoffline) or the focal plane of desimodel. State: desimodel's state, or the newest row of each
// robot in posmovedb. Targets: the table FIBERASSIGN. Moves: rows of posmovedb.
// docs/observatories.md has the columns.
//
//   theta_zero = offset_t + the petal's turn, phi_zero = offset_p
//   base = offset_x_cs5, offset_y_cs5; or offset_x, offset_y of the petal, turned with it
//   theta within half the physical range on either side, phi from 185 - range to 185 degrees
#pragma once

#include "daemon/observatory/plate.h"

namespace focalfleet::observatory {

Result<Plate> ReadDesi(const SourceFiles& files);

}  // namespace focalfleet::observatory
