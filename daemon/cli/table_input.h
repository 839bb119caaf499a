// Tables that commands take. stderr names a file that is not plain CSV: which of its tables was
// read, how many rows it has, and what was passed over.
#pragma once

#include <string>
#include <string_view>

#include "daemon/cli/context.h"
#include "daemon/tables/read_table.h"
#include "protocol/base/result.h"

namespace focalfleet::cli {

/// Says the note of a table on stderr; nothing with --quiet or --json.
void ReportFormat(const Context& context, const std::string& note);

/// The file's table as text for CsvTable: the one with the column `key_column`, else the first.
/// Errors: as ReadTableText.
Result<std::string> ReadTable(const Context& context, const std::string& path,
                              std::string_view key_column);

}  // namespace focalfleet::cli
