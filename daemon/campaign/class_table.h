// The classes of a campaign's axes as a table: a row a class, with the axes of those that are not
// as they should be.
#pragma once

#include <string>
#include <vector>

#include "sim/campaigns/diagnosis/use/axis_classes.h"

namespace focalfleet {

/// Columns of ClassRows.
inline const std::vector<std::string> kClassColumns = {"class", "axes", "which"};

/// A row for each class that an axis is in, in the order of AxisClass. `which` names the first axes
/// of classes other than healthy and unknown: "theta 17, phi 23 and 4 more".
std::vector<std::vector<std::string>> ClassRows(const std::vector<sim::AxisReport>& axes);

/// Whether an axis is in a class that calls for a repair.
bool NeedsRepair(sim::AxisClass axis_class);

}  // namespace focalfleet
