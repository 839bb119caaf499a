#include "daemon/cli/table.h"

#include <fmt/format.h>

#include <algorithm>

#include "daemon/control/printable.h"

namespace focalfleet::cli {
namespace {

std::string Cell(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_null()) return "-";
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  if (!value.is_number_float()) {
    return value.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  std::string text = fmt::format("{:.6f}", value.get<double>());
  while (text.back() == '0') text.pop_back();
  if (text.back() == '.') text.pop_back();
  return text;
}

void Flatten(const std::string& prefix, const Json& value,
             std::vector<std::vector<std::string>>* rows) {
  if (!value.is_object()) {
    rows->push_back({prefix, Cell(value)});
    return;
  }
  for (const auto& [key, member] : value.items()) {
    Flatten(prefix.empty() ? key : prefix + "." + key, member, rows);
  }
}

}  // namespace

std::string AlignColumns(std::vector<std::vector<std::string>> rows) {
  for (auto& row : rows)
    for (std::string& cell : row) cell = Printable(cell);
  std::vector<std::size_t> widths;
  for (const auto& row : rows) {
    widths.resize(std::max(widths.size(), row.size()));
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  }
  std::string text;
  for (const auto& row : rows) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      text += i + 1 == row.size() ? row[i] : fmt::format("{:<{}}  ", row[i], widths[i]);
    }
    text += "\n";
  }
  if (!text.empty()) text.pop_back();
  return text;
}

std::string DescribeObject(const Json& object) {
  std::vector<std::vector<std::string>> rows;
  Flatten("", object, &rows);
  return AlignColumns(rows);
}

std::string DescribeRows(const Json& rows, const std::vector<std::string>& first) {
  std::vector<std::string> keys;
  for (const Json& row : rows) {
    if (!row.is_object()) continue;
    for (const auto& [key, value] : row.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end()) keys.push_back(key);
    }
  }
  const auto rank = [&](const std::string& key) {
    return std::find(first.begin(), first.end(), key) - first.begin();
  };
  std::stable_sort(keys.begin(), keys.end(), [&](const std::string& a, const std::string& b) {
    return std::pair(rank(a), a) < std::pair(rank(b), b);
  });
  if (keys.empty()) return "";
  std::vector<std::vector<std::string>> cells{keys};
  for (const Json& row : rows) {
    std::vector<std::string> line;
    for (const std::string& key : keys) {
      line.push_back(row.is_object() && row.contains(key) ? Cell(row[key]) : "-");
    }
    cells.push_back(std::move(line));
  }
  return AlignColumns(cells);
}

}  // namespace focalfleet::cli
