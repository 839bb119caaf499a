// The motion of a plan as a page plays it: the rows of the plan as bytes. Angles go linearly in
// time within a row, as in plan.csv.
//
// All numbers are little-endian, angles in radians, times in seconds after the start signal.
//
//   bytes  field
//   4      length of what follows
//   1      version of this format: 1
//   3      0
//   4      units that move
//   4      end of the last row (f32)
//   then for each unit, ascending:
//   4      its place in the layout
//   8      directions of theta and phi where it begins, zero angles added (2 x f32)
//   1+1    rows of theta, rows of phi
//   2      0
//   -      for each row: begin, end and the angle that it turns (3 x f32)
//
// A unit is 16 bytes and a row 12: 5000 units with 6 rows are 440 kB, the most that a wire can
// carry, 32,768 units with 30 rows, 12 MB.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "fleet/drive.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"

namespace focalfleet {

/// Shape: `drives` (n), those for which the plan was made. Cost: O(rows).
std::string EncodeMotion(const Plan& plan, const Layout& layout, std::span<const UnitDrive> drives);

/// Whether the bytes are one whole motion of this version, by their length and that of each unit.
bool IsMotion(std::string_view bytes);

}  // namespace focalfleet
