// FitsTable is a FITS binary table as plain columns, in and out. Astronomers' pipelines read FITS.
// The columns have the same names as in this project's CSV files.
//
// Tables are read from memory. The sizes that a file states are checked against the bytes that are
// there. The extended file names of cfitsio can run filters and fetch URLs, so cfitsio never sees a
// name from outside.
#pragma once

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet {

using FitsValues =
    std::variant<std::vector<double>, std::vector<std::int64_t>, std::vector<std::string>>;

struct FitsColumn {
  std::string name;
  std::string unit;  // of the FITS standard: mm, um, deg, s; empty: none
  FitsValues values;
  std::size_t elements = 1;  // numbers a row; their vectors follow each other in `values`
};

struct FitsKey {
  std::string name;  // at most 8 letters
  std::variant<std::int64_t, double, std::string> value;
  std::string comment;
};

struct FitsTable {
  std::string name;  // EXTNAME
  std::vector<FitsKey> keys;
  std::vector<FitsColumn> columns;  // all of equal length

  [[nodiscard]] std::size_t rows() const;
  /// The column of this name; null: there is none. Case does not count, as the FITS standard
  /// states.
  [[nodiscard]] const FitsColumn* Find(std::string_view column) const;
  [[nodiscard]] const FitsKey* FindKey(std::string_view key) const;
};

inline constexpr std::int64_t kFitsRowsMax = 10'000'000;

/// The columns to be read of a file; everything else in it is ignored.
struct FitsWanted {
  /// The first table that has all of these is read. Empty: the first table is read, with all its
  /// columns that have one number or text per row.
  std::vector<std::string> columns;
  std::vector<std::string> optional = {};  // read where that table has them
  std::int64_t rows_max = kFitsRowsMax;
};

/// The table that `wanted` describes. Numbers are whole numbers where the file has them as such
/// (without scaling). Else they are doubles, NaN where one is missing. Keys are those of the table,
/// then those of the primary header that the table lacks and that hold for the whole file.
/// Errors: kInvalid: not FITS, no such table, too long, or a wanted column that holds no number or
/// text per row, or misses a whole number. The text gives the reason after `name`.
Result<FitsTable> ParseFitsTable(std::string bytes, const std::string& name,
                                 const FitsWanted& wanted);
/// The table in the file at `path`.
/// Errors: as ParseFitsTable; also kUnavailable: the file cannot be read.
Result<FitsTable> ReadFitsTable(const std::string& path, const FitsWanted& wanted = {});

/// Afterwards `path` holds the table or, on failure, what it held before.
/// Errors: kUnavailable, names the file.
Status WriteFitsTable(const std::string& path, const FitsTable& table);

}  // namespace focalfleet
