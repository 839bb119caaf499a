#include "daemon/cli/table_input.h"

#include <fmt/format.h>

namespace focalfleet::cli {

void ReportFormat(const Context& context, const std::string& note) {
  if (note.empty() || context.quiet || context.json) return;
  Complain(fmt::format("focalfleet: {}\n", note));
}

Result<std::string> ReadTable(const Context& context, const std::string& path,
                              std::string_view key_column) {
  FOCALFLEET_TRY_ASSIGN(TableText table, ReadTableText(path, key_column));
  ReportFormat(context, table.note);
  return std::move(table.text);
}

}  // namespace focalfleet::cli
