// Rules of words: comments and pages are sentences that begin with their subject, in terms of the
// field.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/tidy/repository.h"

namespace focalfleet::tidy {
namespace {

constexpr std::size_t kDocsLineLengthMax = 200;
constexpr std::size_t kTableCellSentencesMax = 2;

// A sentence that begins with one of these does not name its subject.
constexpr std::string_view kBareOpenings[] = {"Who", "What", "Of", "By", "It", "That", "One", "So"};

// Names that hid a standard term of the field; docs/glossary.md has those that took their place.
// A term of two words is also caught within an identifier. The terms are written in halves, so that
// this file does not complain about itself.
const std::vector<std::pair<std::string, std::string>>& GoneTerms() {
  static const std::vector<std::pair<std::string, std::string>> terms = {
      {std::string("pur") + "suit", "configuration executor"},
      {std::string("notic") + "ing", "stall detection"},
      {std::string("sight") + "ing", "measurement"},
      {std::string("sight") + "ings", "measurements"},
      {std::string("sp") + "ine", "ball-jointed fibre carrier"},
      {std::string("sp") + "ines", "ball-jointed fibre carriers"},
      {std::string("de") + "sk", "request handler"},
      {std::string("sh") + "elf", "model registry"},
      {std::string("out") + "let", "publisher"},
      {std::string("out") + "box", "transmit queue"},
      {std::string("choreo") + "graphy", "local search"},
      {std::string("re") + "treat", "sequential planner"},
      {std::string("mid") + "way", "in-cell planner"},
      {std::string("con") + "tender", "candidate shape"},
      {std::string("con") + "tenders", "candidate shapes"},
      {std::string("mer") + "it", "-BIC"},
      {std::string("cr") + "owd", "cluster"},
      {std::string("to") + "ld", "reported"},
      {std::string("lone ") + "way", "single-unit feasibility"},
  };
  return terms;
}

// Words that are right in code and hide a term in a page.
constexpr std::pair<std::string_view, std::string_view> kGoneFromPages[] = {
    {"remainder", "misfit artefact, or rest"},
    {"remainders", "misfit artefacts"},
};

bool IsScript(std::string_view path) {
  return EndsWith(path, ".py") || EndsWith(path, "CMakeLists.txt");
}
bool IsPage(std::string_view path) { return EndsWith(path, ".md") && path != "CHANGELOG.md"; }

// ---- sentences

/// A run of prose: a comment, a paragraph, an item or a cell.
struct Prose {
  std::string text;                // its lines, joined by blanks
  std::vector<std::size_t> lines;  // Shape: (text); the line of each character
};

void Append(const std::string& text, std::size_t line, Prose* prose) {
  prose->text += text + " ";
  prose->lines.resize(prose->text.size(), line);
}

void Take(Prose* prose, std::vector<Prose>* out) {
  if (!prose->text.empty()) out->push_back(std::move(*prose));
  *prose = {};
}

std::string Trimmed(const std::string& text) {
  const std::size_t first = text.find_first_not_of(' ');
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(' ') - first + 1);
}

std::vector<Prose> CommentsOf(const File& file) {
  std::vector<Prose> out;
  Prose now;
  const auto lines = SplitLines(file.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string comment = Trimmed(lines[i].comment);
    // A comment behind code goes on below where it is aligned with the line before.
    const bool goes_on = i > 0 && lines[i].comment_column == lines[i - 1].comment_column;
    if (lines[i].has_code || comment.empty() || !goes_on) Take(&now, &out);
    if (!comment.empty()) Append(comment, i, &now);
  }
  Take(&now, &out);
  return out;
}

bool BeginsAnItem(const std::string& line) {
  if (StartsWith(line, "- ") || StartsWith(line, "* ")) return true;
  const std::size_t digits = line.find_first_not_of("0123456789");
  return digits != 0 && digits != std::string::npos && line.compare(digits, 2, ". ") == 0;
}

std::vector<std::string> CellsOf(const std::string& row) {
  std::vector<std::string> cells;
  std::string cell;
  bool is_code = false;
  for (const char c : row.substr(1)) {
    if (c == '`') is_code = !is_code;
    if (c == '|' && !is_code)
      cells.push_back(Trimmed(cell)), cell.clear();
    else
      cell += c;
  }
  return cells;
}

std::vector<Prose> ParagraphsOf(const File& file) {
  std::vector<Prose> out;
  Prose now;
  bool is_code = false;
  const auto lines = Lines(file.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string line = Trimmed(lines[i]);
    const bool fence = StartsWith(line, "```");
    const bool row = StartsWith(line, "|");
    if (fence) is_code = !is_code;
    if (fence || is_code || row || line.empty() || line[0] == '#' || BeginsAnItem(line))
      Take(&now, &out);
    if (fence || is_code || line.empty() || line[0] == '#') continue;
    if (row) {
      for (const std::string& cell : CellsOf(line)) {
        Append(cell, i, &now);
        Take(&now, &out);
      }
    } else {
      Append(BeginsAnItem(line) ? line.substr(line.find(' ') + 1) : line, i, &now);
    }
  }
  Take(&now, &out);
  return out;
}

std::vector<Prose> ProseOf(const File& file) {
  if (IsCode(file.path)) return CommentsOf(file);
  if (IsPage(file.path)) return ParagraphsOf(file);
  return {};
}

// Where sentences begin: at the front, and at a capital behind a stop and a blank.
std::vector<std::size_t> SentencesOf(const std::string& text) {
  std::vector<std::size_t> begins = {0};
  for (std::size_t i = 2; i < text.size(); ++i) {
    const bool stop =
        text[i - 1] == ' ' && std::string_view(".!?").find(text[i - 2]) != std::string_view::npos;
    if (stop && std::isupper(static_cast<unsigned char>(text[i])) != 0) begins.push_back(i);
  }
  return begins;
}

Complaints SentencesNameTheirSubject(const Files& files) {
  Complaints out;
  for (const File& file : files)
    for (const Prose& prose : ProseOf(file))
      for (const std::size_t begin : SentencesOf(prose.text))
        for (const std::string_view word : kBareOpenings) {
          const std::string_view rest = std::string_view(prose.text).substr(begin);
          if (StartsWith(rest, word) && !IsWordCharacter(rest[word.size()]) &&
              rest[word.size()] != '-')
            out.push_back(
                At(file, prose.lines[begin], "a sentence begins with a bare " + std::string(word)));
        }
  return out;
}

// ---- terms

// The words of a text in lower case; of an identifier each part.
std::vector<std::string> WordsOf(const std::string& text) {
  std::vector<std::string> words(1);
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto c = static_cast<unsigned char>(text[i]);
    const bool hump =
        std::isupper(c) != 0 && i > 0 && std::islower(static_cast<unsigned char>(text[i - 1])) != 0;
    if ((std::isalpha(c) == 0 || hump) && !words.back().empty()) words.emplace_back();
    if (std::isalpha(c) != 0) words.back() += static_cast<char>(std::tolower(c));
  }
  return words;
}

std::string WithoutQuotedCode(const std::string& line) {
  std::string out;
  bool is_code = false;
  for (const char c : line) {
    if (c == '`') is_code = !is_code;
    if (!is_code) out += c;
  }
  return out;
}

// The words of a text between blanks, in which a term of several words is found as well.
std::string SpokenLine(const std::string& text) {
  std::string line = " ";
  for (const std::string& word : WordsOf(text)) line += word + " ";
  return line;
}

// Texts of programs, keys and columns may keep an older word: others read them.
Complaints TermsAreOfTheField(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    std::vector<std::string> lines;
    if (IsCode(file.path))
      for (const SplitLine& line : SplitLines(file.text))
        lines.push_back(StartsWith(line.code, "#include") ? "" : line.code + " " + line.comment);
    else if (IsPage(file.path) && file.path != "docs/glossary.md")
      for (const std::string& line : Lines(file.text)) lines.push_back(WithoutQuotedCode(line));
    else if (IsScript(file.path))
      lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::string spoken = SpokenLine(lines[i]);
      const auto look_for = [&](std::string_view term, std::string_view instead) {
        const std::string word(term);
        if (spoken.find(" " + word + " ") != std::string::npos)
          out.push_back(At(file, i, word + ": say " + std::string(instead)));
      };
      for (const auto& [term, instead] : GoneTerms()) look_for(term, instead);
      if (!IsPage(file.path)) continue;
      for (const auto& [term, instead] : kGoneFromPages) look_for(term, instead);
    }
  }
  return out;
}

// ---- pages

Complaints PagesAreReadable(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!IsPage(file.path)) continue;
    const auto lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].size() > kDocsLineLengthMax)
        out.push_back(At(file, i, "longer than 200 characters"));
      if (!StartsWith(lines[i], "|")) continue;
      for (const std::string& cell : CellsOf(lines[i]))
        if (SentencesOf(cell).size() > kTableCellSentencesMax)
          out.push_back(At(file, i, "a table cell of more than two sentences: make a list of it"));
    }
  }
  return out;
}

TEST(Tidy, SentencesNameTheirSubject) { ExpectNone(SentencesNameTheirSubject(Tree())); }
TEST(Tidy, TermsAreOfTheField) { ExpectNone(TermsAreOfTheField(Tree())); }
TEST(Tidy, PagesAreReadable) { ExpectNone(PagesAreReadable(Tree())); }

TEST(TidyRules, BareOpeningsAreCaught) {
  const auto code = [](const std::string& text) {
    return Found(SentencesNameTheirSubject, "fleet/a.h", text);
  };
  for (const std::string_view word : kBareOpenings) {
    EXPECT_EQ(code("// " + std::string(word) + " moves stays.\n"), 1u) << word;
    EXPECT_EQ(code("/// The unit moves. " + std::string(word) + " stays.\n"), 1u) << word;
    EXPECT_EQ(code("int a;  // " + std::string(word) + " stays\n"), 1u) << word;
    EXPECT_EQ(code("// The unit moves.\n// " + std::string(word) + " stays.\n"), 1u) << word;
  }
  EXPECT_EQ(code("int a;  // a count\n// What moves\nint b;\n"), 1u);
  EXPECT_EQ(code("int a;  // a count of\n        // What moves\n"), 0u) << "it goes on";
  EXPECT_EQ(code("// The unit of bus 3.\n"), 0u);
  EXPECT_EQ(code("// The unit that moves is the one\n// That is no sentence's beginning.\n"), 0u);
  EXPECT_EQ(code("// Whole numbers, Offsets, Items.\n"), 0u);
  EXPECT_EQ(code("// One-sided bound.\n"), 0u);
  EXPECT_EQ(code("Say(\"What now\");\n"), 0u) << "a text";
  const auto page = [](const std::string& text) {
    return Found(SentencesNameTheirSubject, "docs/a.md", text);
  };
  EXPECT_EQ(page("The unit moves.\nIt stays.\n"), 1u);
  EXPECT_EQ(page("- What stays\n"), 1u);
  EXPECT_EQ(page("1. By chance\n"), 1u);
  EXPECT_EQ(page("| a | It stays. |\n"), 1u);
  EXPECT_EQ(page("```\nWhat\n```\n"), 0u) << "a program's text";
  EXPECT_EQ(page("# What it is\n"), 0u) << "a heading";
}

TEST(TidyRules, GoneTermsAreCaught) {
  for (const auto& [term, instead] : GoneTerms()) {
    std::string camel = term;
    camel[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(camel[0])));
    EXPECT_EQ(Found(TermsAreOfTheField, "fleet/a.h", "int " + term + "_of_unit;\n"), 1u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "fleet/a.h", "class Status" + camel + ";\n"), 1u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "tests/a.cc", "// The " + term + ".\n"), 1u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "docs/a.md", "The " + term + ".\n"), 1u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "fleet/a.cc", "Key(\"" + term + "\");\n"), 0u) << "a text";
    EXPECT_EQ(Found(TermsAreOfTheField, "docs/a.md", "The key `" + term + "`.\n"), 0u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "tests/a.py", "def " + term + "(unit):\n"), 1u) << term;
    EXPECT_EQ(Found(TermsAreOfTheField, "tests/CMakeLists.txt", "# The " + term + ".\n"), 1u)
        << term;
  }
  EXPECT_EQ(Found(TermsAreOfTheField, "docs/a.md", "A remainder of the cause.\n"), 1u);
  EXPECT_EQ(Found(TermsAreOfTheField, "fleet/a.cc", "a = std::remainder(a, 360);\n"), 0u);
  EXPECT_EQ(Found(TermsAreOfTheField, "fleet/a.h", "class LoneWay;\n"), 1u);
}

TEST(TidyRules, UnreadablePagesAreCaught) {
  const auto found = [](const std::string& text) {
    return Found(PagesAreReadable, "docs/a.md", text);
  };
  EXPECT_EQ(found(std::string(201, 'x').append("\n")), 1u);
  EXPECT_EQ(found(std::string(200, 'x').append("\n")), 0u);
  EXPECT_EQ(found("| a | Units move. Units stay. Units end. |\n"), 1u);
  EXPECT_EQ(found("| a | Units move. Units stay. |\n"), 0u);
}

}  // namespace
}  // namespace focalfleet::tidy
