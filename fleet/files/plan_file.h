// plan.csv: the motions of a plan, so that anyone can check it with programs of their own. A row is
// one segment as it goes on the bus. Within it the angle is linear in time, and t = 0 is the start
// signal. Before, between and after its rows an axis stands with its motor off. Angles are whole
// vectors and times whole ticks and timer counts, written with as many digits as give back the same
// number.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/estimate.h"
#include "fleet/layout.h"
#include "fleet/plan/plan.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct PlanRow {
  UnitId unit;
  Axis axis = Axis::kTheta;
  double t0_s = 0;
  double t1_s = 0;
  double from_deg = 0;
  double to_deg = 0;
  WaveMode mode = WaveMode::kAsymmetric;
  double power_W = 0;  // electrical, of this motor during the row
  int line = 0;        // in the file that it came from
};

/// The rows of a plan, ascending by unit's place in the layout, axis and time.
std::vector<PlanRow> RowsOf(const Plan& plan, const Layout& layout,
                            std::span<const UnitDrive> drives, const MotorModel& motor);

std::string WritePlan(std::span<const PlanRow> rows);

/// The rows in the order of the file. Errors: kInvalid with file:line: a column or value missing, a
/// word that is no axis or mode, a row that ends before it begins, negative power, rows of one axis
/// that overlap or do not join up.
Result<std::vector<PlanRow>> ReadPlan(std::string_view text, std::string file);

}  // namespace focalfleet
