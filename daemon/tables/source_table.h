// SourceTable is a table as another program wrote it, before any reader of this project looks at
// it. A file may hold several. Each becomes text for CsvTable, which alone decides what a cell
// means: whatever the format, one reader checks the values and words the refusals.
#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "daemon/files/fits_table.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct SourceTable {
  std::string name;  // EXTNAME, struct, element or member; empty: the file gives none
  std::vector<std::pair<std::string, std::string>> keys = {};  // of the header, in its order
  /// Missing values are NaN, kMissingWhole or an empty text.
  std::vector<FitsColumn> columns = {};
  int header_place = 0;          // line of the header (place.h); 0: the format has none
  std::vector<int> places = {};  // of each row; empty: rows have no lines
  std::vector<std::string> passed_over = {};  // columns that hold no single values

  [[nodiscard]] std::size_t rows() const;
};

inline constexpr std::int64_t kMissingWhole = INT64_MIN;

struct SourceFile {
  std::string format;  // "a FITS file", for messages
  std::vector<SourceTable> tables;
};

/// ECSV text that CsvTable reads, with the units of the columns and the place of every row.
std::string TextOf(const SourceTable& table);

/// Collects rows whose columns show up one after the other, as in JSON and XML.
class RowCollector {
 public:
  /// Starts a row at that place.
  void Begin(int place);
  /// A cell of the row; a second one of the same column is ignored.
  void Put(const std::string& column, std::string value);
  [[nodiscard]] bool Has(const std::string& column) const;
  SourceTable Take(std::string name) &&;

 private:
  std::unordered_map<std::string, std::size_t> index_;
  std::vector<std::string> names_;
  std::vector<std::vector<std::string>> columns_;  // shorter ones end with missing values
  std::vector<int> places_;
};

}  // namespace focalfleet
