// PlanPicture shows a plan as one small SVG that moves: for pages that take pictures but no
// scripts, such as a README. Each arm is two nested groups, and each turns as its axis does, so the
// picture's motion is the rows of plan.csv. A viewer that does not animate shows the start.
#pragma once

#include <string>

#include "daemon/report/plan_page.h"

namespace focalfleet::report {

/// The whole document. The same scene gives the same bytes. Text that `scene` brings is escaped.
/// The motion plays `speed` times as fast as the plan, stands for a moment, and begins again.
/// Cost: about 300 bytes a unit, and 15 bytes a row of its plan. Pre: the shapes fit, speed > 0.
std::string PlanPicture(const PlanScene& scene, double speed);

}  // namespace focalfleet::report
