// A CSV table as the project's files use it: one header line, then one row a line. Lines that start
// with `#` are comments. Lines of nothing but commas and blanks are skipped. A cell may be quoted
// ("" is a quote within); lines may end in CRLF; an empty cell or `nan` is a missing value, and so
// are the words by which databases say so (cell.h). ECSV of astropy reads too, also with its usual
// blanks instead of commas, and its units are converted (column_units.h).
//
// Without a comma in the header cells are separated by semicolons (numbers then may have a decimal
// comma), else by tabs, else by blanks.
//
// Tables of other formats come as ECSV with a comment `#@ N` before each row: N is the row's line
// in the file that the text was made from, or the negative number of the row (place.h).
//
// Columns without a name (the index of pandas, the last commas of spreadsheets) are skipped, as are
// columns that a reader does not know.
//
// Parsing is total: any bytes give a table or an Error that names file, line, column and reason. A
// file that was cut short is refused where that shows. The signs are a row with too few cells, an
// open quote, and a last line without its newline. (A file cut exactly between two lines cannot be
// distinguished from a whole one.)
//
// Cost: linear in the text; a cell by its column's name O(1).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "fleet/files/bad_rows.h"
#include "fleet/files/column_units.h"
#include "protocol/base/result.h"

namespace focalfleet {

class CsvTable {
 public:
  /// The table of the text. Errors: kInvalid: empty, not text, no header, a column twice, more
  /// columns or a longer row than limits.h has, rows of another width, cut short.
  static Result<CsvTable> Parse(std::string_view text, std::string file);

  [[nodiscard]] const std::string& file() const { return file_; }
  /// The names as they stand in the header.
  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }
  /// The name by which Find knows a column: a name in capitals alone, as FITS has them, is known in
  /// small letters (`unit_id` for UNIT_ID, `v_bus_V` for V_BUS_V) unless another column is called
  /// so.
  [[nodiscard]] const std::string& known_as(std::size_t column) const { return known_as_[column]; }
  /// A column as messages call it; "column 1 (no name)" where it has none.
  [[nodiscard]] std::string Shown(std::size_t column) const;
  /// False where it has no name, or the one that pandas gives to a column without (`Unnamed: 0`).
  [[nodiscard]] bool HasName(std::size_t column) const;
  [[nodiscard]] std::optional<std::size_t> Find(std::string_view column) const;
  [[nodiscard]] std::size_t size() const { return lines_.size(); }  // rows
  /// Line of the file in which the row begins, from 1; negative: the number of the row (place.h).
  [[nodiscard]] int line(std::size_t row) const { return lines_[row]; }
  [[nodiscard]] const std::string& cell(std::size_t row, std::size_t column) const {
    return cells_[row * columns_.size() + column];
  }

  /// All columns are there. Errors: kInvalid, names the columns that are missing and those that are
  /// there.
  [[nodiscard]] Status Require(std::initializer_list<std::string_view> columns) const;
  /// Columns that are not among `known`, for a message that they were skipped.
  [[nodiscard]] std::vector<std::string> Others(
      std::initializer_list<std::string_view> known) const;
  /// Columns with a name that no reader has looked for yet, for a message that they were passed
  /// over. Not for tables that several threads read at a time.
  [[nodiscard]] std::vector<std::string> NeverAsked() const;
  [[nodiscard]] Error ErrorAt(std::size_t row, std::string_view reason) const;
  /// Makes numbers of the column's declared unit numbers of the unit in its name.
  [[nodiscard]] const UnitConversion& conversion(std::size_t column) const {
    return conversions_[column];
  }
  /// The unit that the table declares for a column; empty: none.
  [[nodiscard]] const std::string& declared_unit(std::size_t column) const {
    return units_[column];
  }
  /// True if `2,5` is a number.
  [[nodiscard]] bool decimal_comma() const { return decimal_comma_; }

  /// Calls `read(CsvRow&)` for every row, in their order; a reader rejects what it does not take
  /// and keeps nothing of it. Errors: kInvalid, lists all rows that were rejected.
  template <class Read>
  [[nodiscard]] Status ReadRows(Read read) const;

 private:
  friend class CsvParser;
  struct TextHash {
    using is_transparent = void;
    std::size_t operator()(std::string_view text) const {
      return std::hash<std::string_view>()(text);
    }
  };
  std::string file_;
  int header_line_ = 0;
  bool decimal_comma_ = false;
  std::vector<std::string> columns_;
  std::vector<std::string> known_as_;        // Shape: (columns)
  std::vector<std::string> units_;           // as declared; Shape: (columns)
  std::vector<UnitConversion> conversions_;  // Shape: (columns)
  std::unordered_map<std::string, std::size_t, TextHash, std::equal_to<>>
      index_;                        // those with name
  mutable std::vector<char> asked_;  // whether Find was asked for it; Shape: (columns)
  std::vector<int> lines_;
  std::vector<std::string> cells_;  // Shape: (rows, columns), flat
};

struct IntegerBounds {
  std::int64_t low = 0;
  std::int64_t high = 0;
};

/// The cells of one row as values. The first wrong cell is remembered, and the values read after it
/// mean nothing. A reader therefore takes all that it needs and checks error() once.
class CsvRow {
 public:
  CsvRow(const CsvTable& table, std::size_t row) : table_(table), row_(row) {}

  [[nodiscard]] bool Has(std::string_view column) const;  // the column is there and not missing
  double Number(std::string_view column);                 // finite, must be there
  std::optional<double> NumberIfAny(std::string_view column);  // in the unit of the name
  /// A number of a column whose name has no unit, in the one that is wanted: converted where the
  /// table declares another.
  std::optional<double> NumberInIfAny(std::string_view column, std::string_view unit);
  double NumberIn(std::string_view column, std::string_view unit);  // must be there
  std::int64_t Integer(std::string_view column, IntegerBounds bounds);
  std::optional<std::int64_t> IntegerIfAny(std::string_view column, IntegerBounds bounds);
  /// A cell of a 0/1 column: 1 and 0, or as other writers have them: true and false, T and F, in
  /// capitals or not.
  std::optional<bool> FlagIfAny(std::string_view column);
  /// A cell of an unknown column: numbers, and flags as 1 and 0.
  std::optional<double> NumberOrFlagIfAny(std::string_view column);
  /// The cell as it stands, without the blanks around it; empty where there is none.
  [[nodiscard]] std::string Text(std::string_view column) const;

  void Reject(std::string_view column, const std::string& reason);
  /// A fault of more than one cell. Rows with the same `kind` are counted together.
  void RejectRow(std::string_view reason, std::string_view kind);
  [[nodiscard]] std::size_t at() const { return row_; }  // in the table, from 0
  [[nodiscard]] int line() const { return table_.line(row_); }
  [[nodiscard]] const std::optional<Error>& error() const { return error_; }
  [[nodiscard]] const std::string& kind() const { return kind_; }  // of the error

 private:
  // The cell without the blanks around it; empty where the column is not there.
  [[nodiscard]] std::string_view Cell(std::string_view column) const;
  // The number as it stands.
  std::optional<double> PlainNumberIfAny(std::string_view column);
  std::optional<double> Converted(std::string_view column, const UnitConversion& conversion);

  const CsvTable& table_;
  std::size_t row_;
  std::optional<Error> error_;
  std::string kind_;
};

template <class Read>
Status CsvTable::ReadRows(Read read) const {
  BadRows bad;
  for (std::size_t k = 0; k < size(); ++k) {
    CsvRow row(*this, k);
    read(row);
    if (row.error()) bad.Add(row.error()->text, row.kind());
  }
  return bad.Check();
}

/// The shortest decimal text that reads back as the same number; empty for one that is not finite.
std::string NumberText(double value);

/// Builds a table line by line; text is quoted where it must be.
class CsvWriter {
 public:
  explicit CsvWriter(std::span<const std::string_view> columns);
  CsvWriter(std::initializer_list<std::string_view> columns);
  CsvWriter& Number(double value);  // not finite: a missing value
  CsvWriter& Integer(std::int64_t value);
  CsvWriter& Text(std::string_view value);
  CsvWriter& Missing();
  void EndRow();
  void Comment(std::string_view text);  // between two rows; the line is `#` and the text
  [[nodiscard]] std::string Take() { return std::move(text_); }

 private:
  void Separate();
  std::string text_;
  bool row_is_empty_ = true;
};

}  // namespace focalfleet
