#include "daemon/tables/source_table.h"

#include <cstdint>

#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

std::string YamlQuoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' || c == '\n' ? ' ' : c;
  return quoted + "'";
}

void PutCell(const FitsColumn& column, std::size_t row, CsvWriter* csv) {
  if (const auto* numbers = std::get_if<std::vector<double>>(&column.values)) {
    csv->Number((*numbers)[row]);
  } else if (const auto* whole = std::get_if<std::vector<std::int64_t>>(&column.values)) {
    if ((*whole)[row] == kMissingWhole) {
      csv->Missing();
    } else {
      csv->Integer((*whole)[row]);
    }
  } else {
    // A text that is no line of its own: control characters cannot stand in a table.
    std::string text = std::get<std::vector<std::string>>(column.values)[row];
    for (char& c : text)
      if ((static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') || c == 0x7f) c = ' ';
    csv->Text(text);
  }
}

}  // namespace

std::size_t SourceTable::rows() const {
  if (columns.empty()) return 0;
  return std::visit([](const auto& values) { return values.size(); }, columns.front().values);
}

std::string TextOf(const SourceTable& table) {
  std::string text = "# %ECSV 1.0\n# ---\n# delimiter: ','\n# datatype:\n";
  std::vector<std::string_view> names;
  for (const FitsColumn& column : table.columns) {
    names.push_back(column.name);
    if (!column.unit.empty())
      text +=
          "# - {name: " + YamlQuoted(column.name) + ", unit: " + YamlQuoted(column.unit) + "}\n";
  }
  constexpr int kNoLine = -1;
  text += "#@ " + std::to_string(table.header_place != 0 ? table.header_place : kNoLine) + "\n";
  CsvWriter csv(names);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    csv.Comment("@ " + std::to_string(table.places.empty() ? -1 - static_cast<int>(row)
                                                           : table.places[row]));
    for (const FitsColumn& column : table.columns) PutCell(column, row, &csv);
    csv.EndRow();
  }
  return text + csv.Take();
}

void RowCollector::Begin(int place) { places_.push_back(place); }

bool RowCollector::Has(const std::string& column) const {
  const auto found = index_.find(column);
  return found != index_.end() && columns_[found->second].size() == places_.size();
}

void RowCollector::Put(const std::string& column, std::string value) {
  const auto [found, fresh] = index_.emplace(column, columns_.size());
  if (fresh) {
    names_.push_back(column);
    columns_.emplace_back();
  }
  auto& cells = columns_[found->second];
  if (cells.size() == places_.size()) return;
  cells.resize(places_.size() - 1);
  cells.push_back(std::move(value));
}

SourceTable RowCollector::Take(std::string name) && {
  SourceTable table{.name = std::move(name)};
  for (std::size_t column = 0; column < names_.size(); ++column) {
    columns_[column].resize(places_.size());
    table.columns.push_back({std::move(names_[column]), "", std::move(columns_[column])});
  }
  table.places = std::move(places_);
  return table;
}

}  // namespace focalfleet
