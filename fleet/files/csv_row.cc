#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "fleet/files/cell.h"
#include "fleet/files/csv.h"

namespace focalfleet {
namespace {

constexpr const char* kMissing = "the value is missing (empty or nan)";

/// A reason without the cell that it begins with: the part that rows with other values share.
std::string_view WithoutCell(std::string_view reason, std::string_view cell) {
  for (const std::string& shown : {Quoted(cell), std::string(cell)})
    if (!shown.empty() && reason.starts_with(shown + " ")) return reason.substr(shown.size() + 1);
  return reason;
}

/// `2,5` as `2.5`.
std::string WithDecimalPoint(std::string_view cell) {
  std::string text(cell);
  if (std::ranges::count(text, ',') == 1 && text.find('.') == std::string::npos)
    std::ranges::replace(text, ',', '.');
  return text;
}

}  // namespace

void CsvRow::Reject(std::string_view column, const std::string& reason) {
  if (error_) return;
  const std::string where = "column " + std::string(column) + ": ";
  RejectRow(where + reason, where + std::string(WithoutCell(reason, Cell(column))));
}

void CsvRow::RejectRow(std::string_view reason, std::string_view kind) {
  if (error_) return;
  error_ = table_.ErrorAt(row_, reason);
  kind_ = kind;
}

std::string_view CsvRow::Cell(std::string_view column) const {
  const auto index = table_.Find(column);
  return index ? Trimmed(table_.cell(row_, *index)) : std::string_view();
}

bool CsvRow::Has(std::string_view column) const { return !IsMissing(Cell(column)); }

std::string CsvRow::Text(std::string_view column) const { return std::string(Cell(column)); }

std::optional<double> CsvRow::PlainNumberIfAny(std::string_view column) {
  const std::string_view cell = Cell(column);
  if (IsMissing(cell)) return std::nullopt;
  std::optional<double> value = ParseNumber(cell);
  if (!value && table_.decimal_comma()) value = ParseNumber(WithDecimalPoint(cell));
  if (!value) {
    Reject(column, Quoted(cell) + " is not a number");
  } else if (!std::isfinite(*value)) {
    Reject(column, Quoted(cell) + " is not finite");
  } else {
    return value;
  }
  return std::nullopt;
}

std::optional<double> CsvRow::Converted(std::string_view column, const UnitConversion& conversion) {
  const std::optional<double> value = PlainNumberIfAny(column);
  if (!value || !conversion.IsNeeded()) return value;
  if (!conversion.problem.empty()) {
    Reject(column, conversion.problem);
    return std::nullopt;
  }
  return *value * conversion.factor + conversion.offset;
}

std::optional<double> CsvRow::NumberIfAny(std::string_view column) {
  const auto index = table_.Find(column);
  return index ? Converted(column, table_.conversion(*index)) : std::nullopt;
}

std::optional<double> CsvRow::NumberInIfAny(std::string_view column, std::string_view unit) {
  const auto index = table_.Find(column);
  if (!index) return std::nullopt;
  return Converted(column, ConversionOf("a_" + std::string(unit), table_.declared_unit(*index)));
}

double CsvRow::NumberIn(std::string_view column, std::string_view unit) {
  const std::optional<double> value = NumberInIfAny(column, unit);
  if (!value) Reject(column, kMissing);
  return value.value_or(0);
}

double CsvRow::Number(std::string_view column) {
  const std::optional<double> value = NumberIfAny(column);
  if (!value) Reject(column, kMissing);  // keeps an earlier error about the same cell
  return value.value_or(0);
}

std::optional<std::int64_t> CsvRow::IntegerIfAny(std::string_view column, IntegerBounds bounds) {
  constexpr std::int64_t kExactMax = std::int64_t{1} << 53;  // beyond it numbers are not distinct
  bounds = {std::max(bounds.low, -kExactMax), std::min(bounds.high, kExactMax)};
  const std::optional<double> value = NumberIfAny(column);
  if (!value) return std::nullopt;
  if (*value != std::floor(*value)) {
    Reject(column, Quoted(Cell(column)) + " is not a whole number");
  } else if (*value < static_cast<double>(bounds.low) ||
             *value > static_cast<double>(bounds.high)) {
    Reject(column, Quoted(Cell(column)) + " is not between " + std::to_string(bounds.low) +
                       " and " + std::to_string(bounds.high));
  } else {
    return static_cast<std::int64_t>(*value);
  }
  return std::nullopt;
}

std::int64_t CsvRow::Integer(std::string_view column, IntegerBounds bounds) {
  const std::optional<std::int64_t> value = IntegerIfAny(column, bounds);
  if (!value) Reject(column, kMissing);
  return value.value_or(bounds.low);
}

std::optional<bool> CsvRow::FlagIfAny(std::string_view column) {
  const std::string_view cell = Cell(column);
  if (IsMissing(cell)) return std::nullopt;
  if (const auto word = ParseFlagWord(cell)) return word;
  const std::optional<double> value = ParseNumber(cell);
  if (value && (*value == 0 || *value == 1)) return *value == 1;
  Reject(column, Quoted(cell) + " is neither 0 nor 1 (nor false nor true)");
  return std::nullopt;
}

std::optional<double> CsvRow::NumberOrFlagIfAny(std::string_view column) {
  if (const auto word = ParseFlagWord(Cell(column))) return *word ? 1 : 0;
  const auto index = table_.Find(column);
  const bool other_unit = index && !table_.conversion(*index).problem.empty();
  return other_unit ? PlainNumberIfAny(column) : NumberIfAny(column);
}

std::string NumberText(double value) {
  if (!std::isfinite(value)) return {};
  char text[32];
  const auto [end, problem] = std::to_chars(text, text + sizeof text, value == 0 ? 0.0 : value);
  return problem == std::errc() ? std::string(text, end) : std::string();
}

CsvWriter::CsvWriter(std::initializer_list<std::string_view> columns)
    : CsvWriter(std::span<const std::string_view>(columns.begin(), columns.size())) {}

CsvWriter::CsvWriter(std::span<const std::string_view> columns) {
  for (const std::string_view column : columns) Text(column);
  EndRow();
}

void CsvWriter::Separate() {
  if (!row_is_empty_) text_ += ',';
  row_is_empty_ = false;
}

CsvWriter& CsvWriter::Number(double value) {
  Separate();
  text_ += NumberText(value);
  return *this;
}

CsvWriter& CsvWriter::Integer(std::int64_t value) {
  Separate();
  text_ += std::to_string(value);
  return *this;
}

CsvWriter& CsvWriter::Text(std::string_view value) {
  Separate();
  const bool plain = value.find_first_of(",\"\n\r\t #") == std::string_view::npos;
  if (plain) {
    text_ += value;
    return *this;
  }
  text_ += '"';
  for (const char c : value) text_ += c == '"' ? std::string("\"\"") : std::string(1, c);
  text_ += '"';
  return *this;
}

CsvWriter& CsvWriter::Missing() {
  Separate();
  return *this;
}

void CsvWriter::Comment(std::string_view text) { text_.append("#").append(text).append("\n"); }

void CsvWriter::EndRow() {
  text_ += '\n';
  row_is_empty_ = true;
}

}  // namespace focalfleet
