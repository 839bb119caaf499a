// Cells of rows as texts, the same for a column of SQL and for the value that was written to it.
#pragma once

#include <fmt/format.h>
#include <sqlite3.h>

#include <cmath>
#include <concepts>
#include <cstdint>
#include <optional>
#include <string>

namespace focalfleet::soak {

inline constexpr const char* kNullCell = "-";

template <std::integral T>
std::string CellText(T value) {
  return fmt::format("{}", static_cast<std::int64_t>(value));
}
template <class T>
requires std::is_enum_v<T> std::string CellText(T value) {
  return CellText(static_cast<std::int64_t>(value));
}
/// SQLite keeps no NaN and no sign of 0.
inline std::string CellText(double value) {
  return std::isnan(value) ? kNullCell : fmt::format("{:.17g}", value + 0.0);
}
inline std::string CellText(const std::string& value) { return value; }
template <class T>
std::string CellText(const std::optional<T>& value) {
  return value ? CellText(*value) : kNullCell;
}

inline std::string CellText(sqlite3_stmt* row, int column) {
  switch (sqlite3_column_type(row, column)) {
    case SQLITE_NULL:
      return kNullCell;
    case SQLITE_INTEGER:
      return CellText(std::int64_t{sqlite3_column_int64(row, column)});
    case SQLITE_FLOAT:
      return CellText(sqlite3_column_double(row, column));
    default: {
      const void* text = sqlite3_column_blob(row, column);
      const auto size = static_cast<std::size_t>(sqlite3_column_bytes(row, column));
      return text == nullptr ? std::string() : std::string(static_cast<const char*>(text), size);
    }
  }
}

/// Several cells, as a key or as the values of a row.
template <class... Cells>
std::string RowText(const Cells&... cells) {
  return ((CellText(cells) + '|') + ... + std::string());
}

}  // namespace focalfleet::soak
