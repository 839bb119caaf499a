// Answers of the daemon as text for people. Objects become `name  value` lines, lists of objects
// become tables; a member that a later daemon adds shows up without a change here.
#pragma once

#include <string>
#include <vector>

#include "daemon/control/messages.h"

namespace focalfleet::cli {

/// Nested members are named `outer.inner`; numbers keep at most six digits after the point.
std::string DescribeObject(const Json& object);

/// A table of the rows' members: `first` in that order where they exist, then the others by name.
/// Empty: "".
std::string DescribeRows(const Json& rows, const std::vector<std::string>& first);

/// Columns as wide as their widest cell, two blanks between; the last is not padded. A row stays
/// one line, whatever its cells hold (control/printable.h).
std::string AlignColumns(std::vector<std::vector<std::string>> rows);

}  // namespace focalfleet::cli
