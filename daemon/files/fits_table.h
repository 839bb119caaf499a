// A FITS binary table as plain columns, in and out. FITS is what astronomers' pipelines read; the
// same columns as in our CSV files stand under the same names. Tables are read from memory: what a
// file says of itself is held against the bytes that are there, and cfitsio's extended file names,
// which can run filters and fetch URLs, never see a name from outside.
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
};

struct FitsKey {
  std::string name;  // at most 8 letters
  std::variant<std::int64_t, double, std::string> value;
  std::string comment;
};

struct FitsTable {
  std::string name;  // EXTNAME
  std::vector<FitsKey> keys;
  std::vector<FitsColumn> columns;  // all equally long

  [[nodiscard]] std::size_t rows() const;
  /// Case does not count, as FITS says. Null: there is none.
  [[nodiscard]] const FitsColumn* Find(std::string_view column) const;
  [[nodiscard]] const FitsKey* FindKey(std::string_view key) const;
};

inline constexpr std::int64_t kFitsRowsMax = 10'000'000;

/// The columns to be read of a file; whatever else stands in it does not matter.
struct FitsWanted {
  /// The first table that has all of these is meant; empty: the first table, and of it all columns
  /// with one number or text a row.
  std::vector<std::string> columns;
  std::vector<std::string> optional = {};  // taken where that table has them
  std::int64_t rows_max = kFitsRowsMax;
};

/// Numbers come as whole numbers where the file has them as such (without scaling), else as double,
/// NaN where one is missing. Keys are those of the table; then those of the primary header that it
/// lacks, which hold for the whole file. Errors: kInvalid: not FITS, no such table, too long, a
/// wanted column that holds no number or text a row, or misses a whole one; says which, after
/// `name`.
Result<FitsTable> ParseFitsTable(std::string bytes, const std::string& name,
                                 const FitsWanted& wanted);
/// Errors: also kUnavailable: the file cannot be read.
Result<FitsTable> ReadFitsTable(const std::string& path, const FitsWanted& wanted = {});

/// `path` holds the table, or what it held before. Errors: kUnavailable, names the file.
Status WriteFitsTable(const std::string& path, const FitsTable& table);

}  // namespace focalfleet
