#include "daemon/tables/json_source.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "fleet/files/csv.h"
#include "protocol/base/json_marks.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

using Json = nlohmann::ordered_json;

std::string TextOfValue(const Json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "1" : "0";
  if (value.is_number_float()) return NumberText(value.get<double>());
  return value.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void PutMembers(const Json& object, const std::string& prefix, RowCollector* rows) {
  constexpr std::size_t kJsonElementsMax = 32;
  constexpr std::ptrdiff_t kDepthMax = 8;
  if (std::ranges::count(prefix, '.') > kDepthMax) return;
  for (const auto& [key, value] : object.items()) {
    const std::string name = prefix + key;
    if (value.is_object()) {
      PutMembers(value, name + ".", rows);
    } else if (value.is_array() && value.size() <= kJsonElementsMax) {
      for (std::size_t k = 0; k < value.size(); ++k)
        rows->Put(name + "_" + std::to_string(k), TextOfValue(value[k]));
    } else if (!value.is_array()) {
      rows->Put(name, TextOfValue(value));
    }
  }
}

bool IsListOf(const Json& value, bool (Json::*is)() const noexcept) {
  return value.is_array() && !value.empty() &&
         std::ranges::all_of(value, [&](const Json& each) { return (each.*is)(); });
}

SourceTable TableOfObjects(const Json& list, const std::string& name) {
  RowCollector rows;
  int row = 0;
  for (const Json& object : list) {
    rows.Begin(--row);
    PutMembers(object, "", &rows);
  }
  return std::move(rows).Take(name);
}

/// The table of `{"a": [1, 2], "b": [3, 4]}`.
std::optional<SourceTable> TableOfColumns(const Json& object) {
  SourceTable table;
  std::size_t rows = 0;
  for (const auto& [key, value] : object.items()) {
    if (!value.is_array()) continue;
    if (table.columns.empty()) rows = value.size();
    if (value.size() != rows || rows == 0) return std::nullopt;
    std::vector<std::string> cells;
    for (const Json& cell : value) {
      if (cell.is_structured()) return std::nullopt;
      cells.push_back(TextOfValue(cell));
    }
    table.columns.push_back({key, "", std::move(cells)});
  }
  if (table.columns.empty()) return std::nullopt;
  return table;
}

/// The table of `{"columns": ["a", "b"], "data": [[1, 2], [3, 4]]}`.
std::optional<SourceTable> TableOfSplit(const Json& object) {
  const auto names = object.find("columns");
  const auto data = object.find("data");
  if (names == object.end() || data == object.end() || !IsListOf(*names, &Json::is_string) ||
      !IsListOf(*data, &Json::is_array))
    return std::nullopt;
  RowCollector rows;
  int row = 0;
  for (const Json& cells : *data) {
    if (cells.size() != names->size()) return std::nullopt;
    rows.Begin(--row);
    for (std::size_t k = 0; k < cells.size(); ++k)
      rows.Put((*names)[k].get<std::string>(), TextOfValue(cells[k]));
  }
  return std::move(rows).Take("");
}

std::optional<SourceTable> TableOfNamedObjects(const Json& object) {
  if (object.empty() ||
      !std::ranges::all_of(object, [](const Json& each) { return each.is_object(); }))
    return std::nullopt;
  RowCollector rows;
  int row = 0;
  for (const auto& [key, value] : object.items()) {
    rows.Begin(--row);
    rows.Put("key", key);
    PutMembers(value, "", &rows);
  }
  return std::move(rows).Take("");
}

/// The byte, from 1, at which values are nested deeper than any table is; 0: nowhere. The parser
/// and the values' text go as deep as the file does.
std::size_t TooDeepAt(std::string_view text) {
  std::size_t too_deep_at = 0;
  ForEachJsonMark(text, [&](char, std::size_t at, std::size_t depth) {
    if (depth > limits::kTableDepth) too_deep_at = at + 1;
    return too_deep_at == 0;
  });
  return too_deep_at;
}

std::vector<SourceTable> TablesOf(const Json& root) {
  if (IsListOf(root, &Json::is_object)) return {TableOfObjects(root, "")};
  if (!root.is_object()) return {};
  if (auto split = TableOfSplit(root)) return {std::move(*split)};
  std::vector<SourceTable> tables;
  std::vector<std::pair<std::string, std::string>> keys;
  for (const auto& [key, value] : root.items()) {
    if (IsListOf(value, &Json::is_object)) tables.push_back(TableOfObjects(value, key));
    if (value.is_primitive()) keys.emplace_back(key, TextOfValue(value));
  }
  if (tables.empty())
    if (auto columns = TableOfColumns(root)) tables.push_back(std::move(*columns));
  if (tables.empty())
    if (auto named = TableOfNamedObjects(root)) tables.push_back(std::move(*named));
  for (SourceTable& table : tables) table.keys = keys;
  return tables;
}

}  // namespace

Result<SourceFile> ReadJsonSource(std::string_view text, const std::string& name) {
  std::string reason;
  Json root;
  if (const std::size_t deep = TooDeepAt(text); deep != 0)
    return Fail(ErrorCode::kInvalid, name + ": nested too deep, byte " + std::to_string(deep));
  // The only way to learn where it is wrong is the exception.
  try {
    root = Json::parse(text);
  } catch (const Json::parse_error& error) {
    reason = "not JSON, byte " + std::to_string(error.byte);
  } catch (const Json::out_of_range& error) {
    reason = "a number that no column can hold";
  }
  if (!reason.empty()) return Fail(ErrorCode::kInvalid, name + ": " + reason);
  SourceFile file{.format = "a JSON file", .tables = TablesOf(root)};
  if (file.tables.empty())
    return Fail(ErrorCode::kInvalid,
                name + ": no table in this JSON file: a list of objects is expected");
  return file;
}

}  // namespace focalfleet
