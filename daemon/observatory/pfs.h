// PFS and robots like its own (Cobras). Layout: XML of modules. State: angles in a table by
// cobra_id. Targets: the table DESIGN of a pfsDesign or CONFIG of a pfsConfig, with a map of
// fibres. Moves: the tables cobra_move and cobra_match of the operational database, with
// mcs_exposure for times. docs/observatories.md has the columns.
//
//   unit_id = (Module_Id - 1) * 57 + Positioner_Id, the database's cobra_id
//   theta is counted from the counter-clockwise stop: theta_zero = CCW_Global_base_ori_z
//   phi is counted from its inner stop: phi_zero = Joint2_CCW_limit_angle - 180
#pragma once

#include "daemon/observatory/plate.h"

namespace focalfleet::observatory {

Result<Plate> ReadPfs(const SourceFiles& files);

}  // namespace focalfleet::observatory
