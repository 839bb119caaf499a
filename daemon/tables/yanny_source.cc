#include "daemon/tables/yanny_source.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <utility>

#include "fleet/files/cell.h"
#include "fleet/files/last_line.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::size_t kArrayMax = 256;

struct Field {
  std::string name;
  std::size_t elements = 1;
  bool is_array = false;
};

struct Struct {
  std::string name;
  int line = 0;
  std::vector<Field> fields;
  std::vector<std::vector<std::string>> columns;
  std::vector<int> places;
};

bool SameWord(std::string_view a, std::string_view b) {
  return std::ranges::equal(
      a, b, [](unsigned char x, unsigned char y) { return std::tolower(x) == std::tolower(y); });
}

bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

/// Splits a line into its words; a quoted text and what stands in braces are one word each.
class Words {
 public:
  explicit Words(std::string_view line) : line_(line) {}

  /// The next word without its quotes or outer braces. False: the line ends, or `broken`.
  bool Next(std::string* word, bool* braced) {
    while (at_ < line_.size() && IsBlank(line_[at_])) ++at_;
    if (at_ >= line_.size()) return false;
    *braced = line_[at_] == '{';
    if (line_[at_] == '"') return TakeQuoted(word);
    if (*braced) return TakeBraced(word);
    const std::size_t begin = at_;
    while (at_ < line_.size() && !IsBlank(line_[at_])) ++at_;
    *word = line_.substr(begin, at_ - begin);
    return true;
  }
  [[nodiscard]] bool broken() const { return broken_; }

 private:
  bool TakeQuoted(std::string* word) {
    word->clear();
    for (++at_; at_ < line_.size() && line_[at_] != '"'; ++at_) {
      if (line_[at_] == '\\' && at_ + 1 < line_.size() && line_[at_ + 1] == '"') ++at_;
      *word += line_[at_];
    }
    broken_ = at_ >= line_.size();
    ++at_;
    return !broken_;
  }
  bool TakeBraced(std::string* word) {
    const std::size_t begin = at_ + 1;
    int depth = 0;
    bool in_quotes = false;
    for (; at_ < line_.size(); ++at_) {
      if (line_[at_] == '"') in_quotes = !in_quotes;
      if (in_quotes) continue;
      if (line_[at_] == '{') ++depth;
      if (line_[at_] == '}' && --depth == 0) break;
    }
    broken_ = at_ >= line_.size();
    if (broken_) return false;
    *word = line_.substr(begin, at_ - begin);
    ++at_;
    return true;
  }

  std::string_view line_;
  std::size_t at_ = 0;
  bool broken_ = false;
};

class YannyParser {
 public:
  YannyParser(std::string_view text, std::string name) : text_(text), name_(std::move(name)) {}

  Result<SourceFile> Parse() {
    FOCALFLEET_TRY(CheckLastLine(text_, name_));
    while (at_ < text_.size()) {
      const int line = line_;
      std::string logical = TakeLogicalLine();
      const std::string_view trimmed = Trimmed(logical);
      if (trimmed.empty() || trimmed.front() == '#') continue;
      if (trimmed.starts_with("typedef")) {
        FOCALFLEET_TRY(TakeDefinition(std::move(logical), line));
      } else {
        FOCALFLEET_TRY(TakeRow(trimmed, line));
      }
    }
    if (structs_.empty())
      return Fail(ErrorCode::kInvalid, name_ + ": a yanny file, but no struct is defined in it");
    return Tables();
  }

 private:
  [[nodiscard]] tl::unexpected<Error> FailAt(int line, const std::string& reason) const {
    return Fail(ErrorCode::kInvalid, name_ + ":" + std::to_string(line) + ": " + reason);
  }

  /// The next line, with those that it continues on behind a backslash.
  std::string TakeLogicalLine() {
    std::string logical;
    for (;;) {
      const std::size_t end = std::min(text_.find('\n', at_), text_.size());
      std::string_view line = text_.substr(at_, end - at_);
      at_ = std::min(end + 1, text_.size());
      ++line_;
      while (!line.empty() && IsBlank(line.back())) line.remove_suffix(1);
      const bool goes_on = line.ends_with('\\') && at_ < text_.size();
      if (goes_on) line.remove_suffix(1);
      logical += line;
      if (!goes_on) return logical;
      logical += ' ';
    }
  }

  Status TakeDefinition(std::string text, int line) {
    while (text.find('}') == std::string::npos ||
           text.find(';', text.rfind('}')) == std::string::npos) {
      if (at_ >= text_.size())
        return FailAt(line, "a definition does not end: the file is cut short");
      std::string more = TakeLogicalLine();
      more.resize(std::min(more.find('#'), more.size()));
      text += ' ' + more;
    }
    const std::size_t open = text.find('{');
    const std::size_t close = text.rfind('}');
    if (open == std::string::npos || open > close)
      return FailAt(line, "a definition without braces");
    if (text.substr(0, open).find("struct") == std::string::npos) return {};  // an enum
    Struct made;
    made.line = line;
    made.name =
        Trimmed(std::string_view(text).substr(close + 1, text.find(';', close) - close - 1));
    std::string_view fields = std::string_view(text).substr(open + 1, close - open - 1);
    while (!Trimmed(fields).empty()) {
      const std::size_t end = std::min(fields.find(';'), fields.size());
      FOCALFLEET_TRY(TakeField(Trimmed(fields.substr(0, end)), line, &made));
      fields.remove_prefix(std::min(end + 1, fields.size()));
    }
    structs_.push_back(std::move(made));
    return {};
  }

  /// `short positionerId`, `float mag[5]`, `char holeId[28]` (a text), `char names[3][20]`.
  [[nodiscard]] Status TakeField(std::string_view text, int line, Struct* into) const {
    const std::size_t blank = text.find_first_of(" \t");
    if (blank == std::string_view::npos)
      return FailAt(line, "a field without a name: " + Quoted(text));
    const bool is_text = SameWord(text.substr(0, blank), "char");
    std::string_view name = Trimmed(text.substr(blank));
    Field field;
    field.name = Trimmed(name.substr(0, name.find_first_of("[<")));
    std::vector<std::size_t> lengths;
    for (std::size_t at = name.find_first_of("[<"); at != std::string_view::npos;
         at = name.find_first_of("[<", at + 1)) {
      std::size_t length = 0;
      std::from_chars(name.data() + at + 1, name.data() + name.size(), length);
      lengths.push_back(length);
    }
    if (is_text && !lengths.empty()) lengths.pop_back();
    if (!lengths.empty()) {
      field.is_array = true;
      field.elements = lengths.front();
      if (field.elements == 0 || field.elements > kArrayMax || lengths.size() > 1)
        return FailAt(line, "field " + field.name + ": an array of that form is not read");
    }
    into->fields.push_back(field);
    for (std::size_t k = 0; k < field.elements; ++k) into->columns.emplace_back();
    if (into->columns.size() > limits::kCsvColumns) return FailAt(line, "too many fields");
    return {};
  }

  Status TakeRow(std::string_view line_text, int line) {
    Words words(line_text);
    std::string word;
    bool braced = false;
    if (!words.Next(&word, &braced)) return FailAt(line, "a quote is not closed");
    const auto found = std::ranges::find_if(
        structs_, [&](const Struct& each) { return SameWord(each.name, word); });
    if (found == structs_.end()) {
      keys_.emplace_back(word, std::string(Trimmed(line_text.substr(word.size()))));
      return {};
    }
    std::vector<std::string> cells;
    for (const Field& field : found->fields) {
      if (!words.Next(&word, &braced))
        return FailAt(line, found->name + ": the row ends before field " + field.name +
                                (words.broken() ? " (a quote or brace is not closed)" : ""));
      FOCALFLEET_TRY(TakeValue(field, word, braced, line, &cells));
    }
    if (words.Next(&word, &braced))
      return FailAt(line, found->name + ": more values than fields, from " + Quoted(word) + " on");
    for (std::size_t k = 0; k < cells.size(); ++k) found->columns[k].push_back(std::move(cells[k]));
    found->places.push_back(line);
    return {};
  }

  [[nodiscard]] Status TakeValue(const Field& field, const std::string& word, bool braced, int line,
                                 std::vector<std::string>* cells) const {
    if (!field.is_array) {
      cells->push_back(braced && Trimmed(word) == "{}" ? "" : word);
      return {};
    }
    Words elements(word);
    std::string element;
    bool inner = false;
    std::size_t count = 0;
    for (; elements.Next(&element, &inner); ++count) {
      if (count == field.elements)
        return FailAt(line, "field " + field.name + ": more than " +
                                std::to_string(field.elements) + " elements");
      cells->push_back(element);
    }
    if (count != field.elements)
      return FailAt(line, "field " + field.name + ": " + std::to_string(count) +
                              " elements are not " + std::to_string(field.elements));
    return {};
  }

  SourceFile Tables() {
    SourceFile file{.format = "a yanny file", .tables = {}};
    for (Struct& each : structs_) {
      SourceTable table{.name = each.name, .keys = keys_, .header_place = each.line};
      std::size_t column = 0;
      for (const Field& field : each.fields)
        for (std::size_t k = 0; k < field.elements; ++k)
          table.columns.push_back(
              {field.is_array ? field.name + "_" + std::to_string(k) : field.name, "",
               std::move(each.columns[column++])});
      table.places = std::move(each.places);
      file.tables.push_back(std::move(table));
    }
    return file;
  }

  std::string_view text_;
  std::string name_;
  std::size_t at_ = 0;
  int line_ = 1;
  std::vector<Struct> structs_;
  std::vector<std::pair<std::string, std::string>> keys_;
};

}  // namespace

bool IsYanny(std::string_view text) {
  if (text.starts_with("#%yanny")) return true;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = Trimmed(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (line.starts_with("typedef"))
      return line.find("struct") != std::string_view::npos ||
             line.find("enum") != std::string_view::npos;
    const bool may_go_on = line.empty() || line.front() == '#' || line == "\r";
    if (!may_go_on) return false;
  }
  return false;
}

Result<SourceFile> ReadYannySource(std::string_view text, const std::string& name) {
  return YannyParser(text, name).Parse();
}

}  // namespace focalfleet
