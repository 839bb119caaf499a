#include "fleet/files/csv.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "fleet/files/cell.h"
#include "fleet/files/foreign_format.h"
#include "fleet/files/last_line.h"
#include "fleet/files/place.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

std::string JoinedNames(const std::vector<std::string>& names) {
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined;
}

/// `Unnamed: 0`, and `Unnamed: 0.1` of a table that was read and written twice.
bool IsUnnamed(std::string_view name) {
  constexpr std::string_view kPandas = "Unnamed: ";
  return name.empty() ||
         (name.starts_with(kPandas) &&
          name.substr(kPandas.size()).find_first_not_of("0123456789.") == std::string_view::npos);
}

/// A name in capitals alone as this project would write it; other names as they stand.
std::string InSmallLetters(const std::string& name) {
  const auto is_small = [](char c) { return c >= 'a' && c <= 'z'; };
  const auto is_capital = [](char c) { return c >= 'A' && c <= 'Z'; };
  if (name.size() < 2 || std::ranges::any_of(name, is_small)) return name;
  std::string small = name;
  for (char& c : small)
    if (is_capital(c)) c = static_cast<char>(c - 'A' + 'a');
  constexpr std::string_view kCapitalUnits[] = {"_v", "_a", "_w", "_j", "_c"};
  for (const std::string_view unit : kCapitalUnits)
    if (small.ends_with(unit)) small.back() = name.back();
  return small;
}

}  // namespace

// Parses the text in one pass, one character at a time; the state is the cell being read.
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
    FOCALFLEET_TRY(of_another_width_.Check());
    return std::move(table_);
  }

 private:
  [[nodiscard]] tl::unexpected<Error> FailAt(int line, const std::string& reason) const {
    return Fail(ErrorCode::kInvalid, PlaceIn(table_.file_, line) + ": " + reason);
  }

  Status CheckIsText() {
    if (const auto format = ForeignFormat(text_))
      return Fail(ErrorCode::kInvalid, table_.file_ + ": this is " + *format);
    if (text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
    if (text_.find('\n') == std::string_view::npos && text_.find('\r') != std::string_view::npos) {
      with_line_ends_ = text_;  // lines of an old Macintosh
      std::ranges::replace(with_line_ends_, '\r', '\n');
      text_ = with_line_ends_;
    }
    int line = 1;
    for (const char c : text_) {
      const auto byte = static_cast<unsigned char>(c);
      if (c == '\n') ++line;
      if (byte >= 0x20 || c == '\n' || c == '\r' || c == '\t') continue;
      char reason[64];
      std::snprintf(reason, sizeof reason, "not a text file (byte 0x%02x)", unsigned{byte});
      return FailAt(line, reason);
    }
    return CheckLastLine(text_, table_.file_);
  }

  // Parses up to and including one newline outside quotes. The text is known to end in one.
  Status ParseLine() {
    const int line = place_ != 0 ? place_ : line_;
    const std::string_view rest = RestOfLine();
    const char* nothing = table_.decimal_comma_ ? " \t,;" : " \t,";
    if (rest.starts_with('#')) TakeComment(rest.substr(1));
    if (rest.find_first_not_of(nothing) == std::string_view::npos || rest.starts_with('#')) {
      SkipLine();
      return {};
    }
    if (table_.header_line_ == 0) ChooseSeparator(rest);
    row_begin_ = at_;
    std::vector<std::string> cells;
    do {
      FOCALFLEET_TRY_ASSIGN(std::string cell, ParseCell());
      cells.push_back(std::move(cell));
      if (cells.size() > limits::kCsvColumns)
        return FailAt(line, "more than " + std::to_string(limits::kCsvColumns) +
                                (table_.header_line_ == 0 ? " columns" : " cells"));
    } while (NextCellInLine());
    if (table_.header_line_ == 0) return TakeHeader(line, std::move(cells));
    TakeRow(line, std::move(cells));
    return {};
  }

  void TakeComment(std::string_view comment) {
    constexpr std::string_view kPlace = "@ ";
    if (comment.starts_with(" %ECSV")) is_ecsv_ = true;
    if (comment.starts_with(kPlace)) {
      const auto number = ParseNumber(comment.substr(kPlace.size()));
      if (number && std::abs(*number) < 1e9) place_ = static_cast<int>(*number);
    } else if (is_ecsv_ && table_.header_line_ == 0) {
      units_.Take(comment);
    }
  }

  [[nodiscard]] std::string_view NextLine() const {
    const std::size_t end = text_.find('\n', at_);
    if (end == std::string_view::npos) return {};
    return text_.substr(end + 1, text_.find('\n', end + 1) - end - 1);
  }
  static std::size_t WordsIn(std::string_view line) {
    std::size_t words = 0;
    char before = ' ';
    for (const char c : line) {
      if (c != ' ' && c != '\r' && before == ' ') ++words;
      before = c;
    }
    return words;
  }

  /// Chooses what separates cells, by the header. Commas come first: a semicolon beside them is
  /// part of a name. Blanks are the last: the next line must have as many words, or they are part
  /// of the only column's name.
  void ChooseSeparator(std::string_view header) {
    bool in_quotes = false;
    bool any[256] = {};
    for (const char c : header) {
      if (c == '"') in_quotes = !in_quotes;
      if (!in_quotes) any[static_cast<unsigned char>(c)] = true;
    }
    separator_ = any[','] ? ',' : any[';'] ? ';' : any['\t'] ? '\t' : ',';
    by_blanks_ = !any[','] && !any[';'] &&
                 (is_ecsv_ || (!any['\t'] && any[' '] && WordsIn(header) == WordsIn(NextLine())));
    table_.decimal_comma_ = separator_ == ';';
  }

  [[nodiscard]] bool RowIsTooLong() const { return at_ - row_begin_ > limits::kCsvRowBytes; }
  [[nodiscard]] tl::unexpected<Error> FailTooLong(int line) const {
    return FailAt(line, "the row is longer than " + std::to_string(limits::kCsvRowBytes >> 10) +
                            " KiB: is a quote not closed?");
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
    while (text_[at_] == ' ' || (text_[at_] == '\t' && (by_blanks_ || separator_ != '\t'))) ++at_;
  }
  [[nodiscard]] bool AtLineEnd() const {
    return text_[at_] == '\n' || text_.substr(at_, 2) == "\r\n";
  }
  [[nodiscard]] bool AtCellEnd() const {
    if (AtLineEnd()) return true;
    return by_blanks_ ? text_[at_] == ' ' || text_[at_] == '\t' : text_[at_] == separator_;
  }

  // Steps over what separates cells. False: the end of the line, which it steps over too.
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
    if (RowIsTooLong()) return FailTooLong(line_);
    return std::string(Trimmed(text_.substr(begin, at_ - begin)));
  }

  Result<std::string> ParseQuoted() {
    const int line = line_;
    std::string cell;
    for (++at_; at_ < text_.size(); ++at_) {
      if (RowIsTooLong()) return FailTooLong(line);
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
    for (std::size_t column = 0; column < cells.size(); ++column) {
      if (IsUnnamed(cells[column])) continue;
      if (!table_.index_.emplace(cells[column], column).second)
        return FailAt(line, "column " + Quoted(cells[column]) + " is there twice");
    }
    for (std::size_t column = 0; column < cells.size(); ++column) {
      const std::string small = InSmallLetters(cells[column]);
      const bool is_known = small != cells[column] && table_.index_.emplace(small, column).second;
      table_.known_as_.push_back(is_known ? small : cells[column]);
    }
    table_.units_.resize(cells.size());
    table_.conversions_.resize(cells.size());
    for (const auto& [name, unit] : units_.Units())
      if (const auto found = table_.index_.find(name); found != table_.index_.end()) {
        const std::size_t column = found->second;
        table_.units_[column] = unit;
        table_.conversions_[column] = ConversionOf(table_.known_as_[column], unit);
      }
    table_.asked_.assign(cells.size(), 0);
    table_.columns_ = std::move(cells);
    return {};
  }

  void TakeRow(int line, std::vector<std::string> cells) {
    const std::size_t width = table_.columns_.size();
    // Separators behind the last cell, as spreadsheets leave them.
    while (cells.size() > width && cells.back().empty()) cells.pop_back();
    if (cells.size() != width) {
      const char* kind = cells.size() < width ? "too few cells" : "too many cells";
      of_another_width_.Add(
          FailAt(line, std::to_string(cells.size()) + " cells, but the header has " +
                           std::to_string(width) + " columns" +
                           (cells.size() < width ? ": cut short?" : ""))
              .value()
              .text,
          kind);
      return;
    }
    table_.lines_.push_back(line);
    std::move(cells.begin(), cells.end(), std::back_inserter(table_.cells_));
  }

  std::string with_line_ends_;
  std::string_view text_;
  std::size_t at_ = 0;
  std::size_t row_begin_ = 0;
  int line_ = 1;
  int place_ = 0;  // of the next row in the file that the text was made from; 0: not made from one
  bool is_ecsv_ = false;
  bool by_blanks_ = false;  // ECSV's usual separator
  char separator_ = ',';
  EcsvUnits units_;
  CsvTable table_;
  BadRows of_another_width_;
};

Result<CsvTable> CsvTable::Parse(std::string_view text, std::string file) {
  return CsvParser(text, std::move(file)).Parse();
}

std::string CsvTable::Shown(std::size_t column) const {
  return columns_[column].empty() ? "column " + std::to_string(column + 1) + " (no name)"
                                  : columns_[column];
}

bool CsvTable::HasName(std::size_t column) const { return !IsUnnamed(columns_[column]); }

std::optional<std::size_t> CsvTable::Find(std::string_view column) const {
  const auto it = index_.find(column);
  if (it == index_.end()) return std::nullopt;
  asked_[it->second] = 1;
  return it->second;
}

Status CsvTable::Require(std::initializer_list<std::string_view> columns) const {
  std::vector<std::string> missing;
  for (const std::string_view column : columns)
    if (!Find(column)) missing.emplace_back(column);
  if (missing.empty()) return {};
  std::vector<std::string> all;
  for (std::size_t column = 0; column < columns_.size(); ++column) all.push_back(Shown(column));
  std::string found = JoinedNames(all);
  constexpr std::size_t kShown = 300;
  if (found.size() > kShown) found = found.substr(0, kShown) + "...";
  return Fail(ErrorCode::kInvalid, (header_line_ > 0 ? PlaceIn(file_, header_line_) : file_) +
                                       ": column " + JoinedNames(missing) +
                                       " is missing; there are: " + found);
}

std::vector<std::string> CsvTable::Others(std::initializer_list<std::string_view> known) const {
  std::vector<std::string> others;
  for (std::size_t column = 0; column < columns_.size(); ++column)
    if (std::find(known.begin(), known.end(), known_as_[column]) == known.end())
      others.push_back(Shown(column));
  return others;
}

std::vector<std::string> CsvTable::NeverAsked() const {
  std::vector<std::string> never;
  for (std::size_t column = 0; column < columns_.size(); ++column)
    if (asked_[column] == 0 && HasName(column)) never.push_back(columns_[column]);
  return never;
}

Error CsvTable::ErrorAt(std::size_t row, std::string_view reason) const {
  return {ErrorCode::kInvalid, PlaceIn(file_, line(row)) + ": " + std::string(reason)};
}

}  // namespace focalfleet
