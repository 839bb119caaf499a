// units.csv: where each unit sits, how long its arms are, which supply and bus feed it.
// docs/files.md has the columns. Reading checks each row by itself and names its line. Faults of
// several units (two at one address, one place twice) are found by Layout::Create, and ReadLayout
// adds the line to those, too.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "fleet/layout.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct UnitsFile {
  std::string source;
  std::vector<Unit> units;
  std::vector<int> lines;                    // Shape: (n), of each unit's row
  std::vector<std::string> columns;          // of the header: the others have their defaults
  std::vector<std::string> ignored_columns;  // unknown; a misspelt `enabled` would be among them
};

/// Every row checked by itself. Errors: kInvalid with file:line: a column missing; of all rows a
/// value missing or out of its bounds, a unit twice.
Result<UnitsFile> ReadUnits(std::string_view text, std::string file);

/// ReadUnits and Layout::Create in one, errors of both with file:line.
Result<Layout> ReadLayout(std::string_view text, std::string file, Layout::Options options);

/// A table with all columns but optional ones that no unit has. The text reads back equal.
std::string WriteUnits(std::span<const Unit> units);

}  // namespace focalfleet
