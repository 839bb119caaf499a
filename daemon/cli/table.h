// These functions show the daemon's answers as text for human readers. Objects become `name  value`
// lines, lists of objects become tables. A member that a later daemon adds is shown without a
// change here.
#pragma once

#include <string>
#include <vector>

#include "daemon/control/messages.h"

namespace focalfleet::cli {

/// The object as lines. Nested members are named `outer.inner`; numbers keep at most six digits
/// after the point.
std::string DescribeObject(const Json& object);

/// A table of the rows' members: `first` in that order where they exist, then the others by name.
/// No rows give "".
std::string DescribeRows(const Json& rows, const std::vector<std::string>& first);

/// The rows as text. Columns are as wide as their widest cell, two blanks apart; the last column is
/// not padded. A row stays one line, whatever its cells hold (control/printable.h).
std::string AlignColumns(std::vector<std::vector<std::string>> rows);

}  // namespace focalfleet::cli
