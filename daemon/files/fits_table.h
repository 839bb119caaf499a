// A FITS binary table as plain columns, in and out. FITS is what astronomers' pipelines read; the
// same columns as in our CSV files stand under the same names. Files are opened by their exact
// name: cfitsio's extended file names, which can run filters and fetch URLs, are off.
#pragma once

#include <cstdint>
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

/// The first binary table of a file. Numbers come as whole numbers where the file has them as such
/// (without scaling), else as double; a missing whole number is an error. Columns that hold more
/// than one value a row are left out. Errors: kUnavailable: not readable; kInvalid: not FITS, no
/// table, too long; names the file and cfitsio's reason.
Result<FitsTable> ReadFitsTable(const std::string& path);

/// `path` holds the table, or what it held before. Errors: kUnavailable, names the file.
Status WriteFitsTable(const std::string& path, const FitsTable& table);

}  // namespace focalfleet
