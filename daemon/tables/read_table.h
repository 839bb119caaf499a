// The one reader of tables. Whatever a command takes as a table may be CSV with its variants
// (csv.h), ECSV, a FITS binary table, a yanny file, JSON, XML or a VOTable, packed by gzip or not.
// The format shows in the content; names of files do not count. A table of another format becomes
// text here, and the readers of targets, units and moves never know.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "daemon/tables/source_table.h"
#include "fleet/files/csv.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct TableText {
  std::string text;  // for CsvTable
  std::string note;  // what the file is, where it is not plain text; empty: it is
};

/// The file's table that has the column `key_column`, else its first one.
/// Errors: as ReadFile; kInvalid: not a table of any format; the text names the file.
Result<TableText> ReadTableText(const std::string& path, std::string_view key_column);
/// The same of bytes that were read from `path`.
Result<TableText> TableTextOf(std::string bytes, const std::string& path,
                              std::string_view key_column);

/// ReadTableText without the note.
Result<std::string> ReadTableAsText(const std::string& path, std::string_view key_column);

/// A table of a file, ready to be read.
struct NamedTable {
  std::string name;
  std::vector<std::pair<std::string, std::string>> keys;
  CsvTable table;

  /// The text of a header key; empty: there is none.
  [[nodiscard]] std::string Key(std::string_view wanted) const;
};

/// All tables of the file. Errors: as ReadTableText.
Result<std::vector<NamedTable>> ReadTables(const std::string& path);

/// The name of the table `stem` in a folder: `stem.csv` or with another extension that tables have;
/// `stem.csv` where none is there.
std::string FindTable(const std::string& folder, const std::string& stem);

}  // namespace focalfleet
