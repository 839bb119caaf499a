#include "fleet/files/csv.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <system_error>

namespace focalfleet {
namespace {

constexpr const char* kMissing = "the value is missing (empty or nan)";

std::string Lower(std::string_view text) {
  std::string lower(text);
  for (char& c : lower)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return lower;
}

bool IsMissing(std::string_view cell) {
  return cell.empty() || (cell.size() == 3 && Lower(cell) == "nan");
}

std::string_view Trimmed(std::string_view text) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

// What a person can read of a cell that may hold anything.
std::string Quoted(std::string_view cell) {
  constexpr std::size_t kShown = 40;
  std::string shown = "'";
  for (const char c : cell.substr(0, kShown))
    shown += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
  return shown + (cell.size() > kShown ? "...'" : "'");
}

std::string JoinedNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined;
}

std::optional<double> ParseNumber(std::string_view cell) {
  if (cell.starts_with('+') && !cell.starts_with("+-")) cell.remove_prefix(1);
  double value = 0;
  const auto [end, problem] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (problem != std::errc() || end != cell.data() + cell.size()) return std::nullopt;
  return value;
}

}  // namespace

// One pass over the text, one character at a time; the state is the cell being read.
class CsvParser {
 public:
  CsvParser(std::string_view text, std::string file) : text_(text) {
    table_.file_ = std::move(file);
  }

  Result<CsvTable> Parse() {
    FOCALFLEET_TRY(CheckIsText());
    while (at_ < text_.size()) FOCALFLEET_TRY(ParseLine());
    if (table_.header_line_ == 0)
      return Fail(ErrorCode::kInvalid, table_.file_ + ": empty, a header line is expected");
    return std::move(table_);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> FailAt(int line, const std::string& reason) const {
    return Fail(ErrorCode::kInvalid, table_.file_ + ":" + std::to_string(line) + ": " + reason);
  }

  Status CheckIsText() {
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
    if (text_.starts_with("SIMPLE  ="))
      return FailAt(1, "this is a FITS file, a CSV table is expected");
    int line = 1;
    for (const char c : text_) {
      const auto byte = static_cast<unsigned char>(c);
      if (c == '\n') ++line;
      if (byte >= 0x20 || c == '\n' || c == '\r' || c == '\t') continue;
      char reason[64];
      std::snprintf(reason, sizeof reason, "not a text file (byte 0x%02x)", unsigned{byte});
      return FailAt(line, reason);
    }
    if (!text_.empty() && text_.back() != '\n')
      return FailAt(line,
                    "the last line does not end: the file is cut short (or end it with a newline)");
    return {};
  }

  // Up to and including one newline outside quotes. The text is known to end in one.
  Status ParseLine() {
    const int line = line_;
    if (Trimmed(RestOfLine()).empty() || RestOfLine().starts_with('#')) {
      if (RestOfLine().starts_with("# %ECSV")) is_ecsv_ = true;
      SkipLine();
      return {};
    }
    if (table_.header_line_ == 0)
      by_blanks_ = is_ecsv_ && RestOfLine().find(',') == std::string_view::npos;
    std::vector<std::string> cells;
    do {
      FOCALFLEET_TRY_ASSIGN(std::string cell, ParseCell());
      cells.push_back(std::move(cell));
    } while (NextCellInLine());
    return table_.header_line_ == 0 ? TakeHeader(line, std::move(cells))
                                    : TakeRow(line, std::move(cells));
  }

  [[nodiscard]] std::string_view RestOfLine() const {
    std::string_view rest = text_.substr(at_, text_.find('\n', at_) - at_);
    if (rest.ends_with('\r')) rest.remove_suffix(1);
    return rest;
  }
  void SkipLine() {
    at_ = text_.find('\n', at_) + 1;
    ++line_;
  }
  void SkipBlanks() {
    while (text_[at_] == ' ' || text_[at_] == '\t') ++at_;
  }
  [[nodiscard]] bool AtLineEnd() const {
    return text_[at_] == '\n' || text_.substr(at_, 2) == "\r\n";
  }
  [[nodiscard]] bool AtCellEnd() const {
    if (AtLineEnd()) return true;
    return by_blanks_ ? text_[at_] == ' ' || text_[at_] == '\t' : text_[at_] == ',';
  }

  // Steps over what separates cells; false at the end of the line, which it steps over too.
  bool NextCellInLine() {
    if (by_blanks_) SkipBlanks();
    if (AtLineEnd()) {
      SkipLine();
      return false;
    }
    if (!by_blanks_) ++at_;
    return true;
  }

  Result<std::string> ParseCell() {
    SkipBlanks();
    if (text_[at_] == '"') return ParseQuoted();
    const std::size_t begin = at_;
    while (!AtCellEnd()) ++at_;
    return std::string(Trimmed(text_.substr(begin, at_ - begin)));
  }

  Result<std::string> ParseQuoted() {
    const int line = line_;
    std::string cell;
    for (++at_; at_ < text_.size(); ++at_) {
      if (text_[at_] == '\n') ++line_;
      if (text_[at_] != '"') {
        cell += text_[at_];
        continue;
      }
      if (at_ + 1 < text_.size() && text_[at_ + 1] == '"') {
        cell += '"';
        ++at_;
        continue;
      }
      ++at_;
      if (!by_blanks_) SkipBlanks();
      if (!AtCellEnd()) return FailAt(line_, "text after a closing quote");
      return cell;
    }
    return FailAt(line, "a quote is not closed: the file is cut short or wrong");
  }

  Status TakeHeader(int line, std::vector<std::string> cells) {
    table_.header_line_ = line;
    for (const std::string& name : cells) {
      if (name.empty()) return FailAt(line, "a column of the header has no name");
      if (std::count(cells.begin(), cells.end(), name) > 1)
        return FailAt(line, "column " + Quoted(name) + " is there twice");
    }
    table_.columns_ = std::move(cells);
    return {};
  }

  Status TakeRow(int line, std::vector<std::string> cells) {
    if (cells.size() != table_.columns_.size())
      return FailAt(line, std::to_string(cells.size()) + " cells, but the header has " +
                              std::to_string(table_.columns_.size()) + " columns" +
                              (cells.size() < table_.columns_.size() ? ": cut short?" : ""));
    table_.lines_.push_back(line);
    std::move(cells.begin(), cells.end(), std::back_inserter(table_.cells_));
    return {};
  }

  std::string_view text_;
  std::size_t at_ = 0;
  int line_ = 1;
  bool is_ecsv_ = false;
  bool by_blanks_ = false;  // ECSV's usual separator
  CsvTable table_;
};

Result<CsvTable> CsvTable::Parse(std::string_view text, std::string file) {
  return CsvParser(text, std::move(file)).Parse();
}

std::optional<std::size_t> CsvTable::Find(std::string_view column) const {
  const auto it = std::find(columns_.begin(), columns_.end(), column);
  if (it == columns_.end()) return std::nullopt;
  return static_cast<std::size_t>(it - columns_.begin());
}

Status CsvTable::Require(std::initializer_list<std::string_view> columns) const {
  std::vector<std::string> missing;
  for (const std::string_view column : columns)
    if (!Find(column)) missing.emplace_back(column);
  if (missing.empty()) return {};
  std::string found = JoinedNames(columns_);
  constexpr std::size_t kShown = 300;
  if (found.size() > kShown) found = found.substr(0, kShown) + "...";
  return Fail(ErrorCode::kInvalid, file_ + ":" + std::to_string(header_line_) + ": column " +
                                       JoinedNames(missing) + " is missing; there are: " + found);
}

std::vector<std::string> CsvTable::Others(std::initializer_list<std::string_view> known) const {
  std::vector<std::string> others;
  for (const std::string& column : columns_)
    if (std::find(known.begin(), known.end(), column) == known.end()) others.push_back(column);
  return others;
}

Error CsvTable::ErrorAt(std::size_t row, std::string_view reason) const {
  return {ErrorCode::kInvalid,
          file_ + ":" + std::to_string(line(row)) + ": " + std::string(reason)};
}

void CsvRow::Reject(std::string_view column, const std::string& reason) {
  if (!error_) error_ = table_.ErrorAt(row_, "column " + std::string(column) + ": " + reason);
}

std::string_view CsvRow::Cell(std::string_view column) const {
  const auto index = table_.Find(column);
  return index ? Trimmed(table_.cell(row_, *index)) : std::string_view();
}

bool CsvRow::Has(std::string_view column) const { return !IsMissing(Cell(column)); }

std::string CsvRow::Text(std::string_view column) const { return std::string(Cell(column)); }

std::optional<double> CsvRow::NumberIfAny(std::string_view column) {
  const std::string_view cell = Cell(column);
  if (IsMissing(cell)) return std::nullopt;
  const std::optional<double> value = ParseNumber(cell);
  if (!value) {
    Reject(column, Quoted(cell) + " is not a number");
  } else if (!std::isfinite(*value)) {
    Reject(column, Quoted(cell) + " is not finite");
  } else {
    return value;
  }
  return std::nullopt;
}

double CsvRow::Number(std::string_view column) {
  const std::optional<double> value = NumberIfAny(column);
  if (!value) Reject(column, kMissing);  // keeps an earlier error about the same cell
  return value.value_or(0);
}

std::optional<std::int64_t> CsvRow::IntegerIfAny(std::string_view column, IntegerBounds bounds) {
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

void CsvWriter::EndRow() {
  text_ += '\n';
  row_is_empty_ = true;
}

}  // namespace focalfleet
