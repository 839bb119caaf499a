// Rules of pages against code: a page names files and tests that exist, and the two pages that
// follow a way through the code name functions that the headers beside them declare.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/tidy/repository.h"

namespace focalfleet::tidy {
namespace {

// Pages that follow a way through the code: all of their functions stand beside a file.
constexpr std::string_view kWays[] = {"docs/way_of_a_move.md", "docs/way_of_a_campaign.md",
                                      "docs/way_of_a_change.md"};

constexpr std::string_view kFaultMatrix = "docs/fault-matrix.md";
constexpr std::string_view kThreatModel = "docs/threat-model.md";

constexpr std::string_view kFolders[] = {"protocol/", "fleet/", "sim/",   "daemon/",
                                         "tests/",    "docs/",  "deploy/"};
constexpr std::string_view kEndings[] = {".h", ".cc", ".c", ".md", ".py", ".toml", ".idl"};

bool IsPathCharacter(char c) {
  return IsWordCharacter(c) || std::string_view("/.-").find(c) != std::string_view::npos;
}

// Paths from the repository's root: a known folder first, and a file's ending, or a `/`, last.
std::vector<std::string> PathsOf(const std::string& line) {
  std::vector<std::string> paths;
  for (std::size_t i = 0; i < line.size();) {
    std::size_t end = i;
    while (end < line.size() && IsPathCharacter(line[end])) ++end;
    std::string word = line.substr(i, end - i);
    i = end + 1;
    while (EndsWith(word, ".")) word.pop_back();  // the end of a sentence
    const auto begins = [&](std::string_view folder) { return StartsWith(word, folder); };
    const auto ends = [&](std::string_view ending) { return EndsWith(word, ending); };
    if (std::any_of(std::begin(kFolders), std::end(kFolders), begins) &&
        (EndsWith(word, "/") || std::any_of(std::begin(kEndings), std::end(kEndings), ends)))
      paths.push_back(word);
  }
  return paths;
}

bool Exists(const Files& files, const std::string& path) {
  return std::any_of(files.begin(), files.end(), [&](const File& file) {
    return file.path == path || (EndsWith(path, "/") && StartsWith(file.path, path));
  });
}

Complaints PagesNameFilesThatExist(const Files& files) {
  Complaints out;
  for (const File& page : files) {
    if (!EndsWith(page.path, ".md") || page.path == "CHANGELOG.md") continue;
    const auto lines = Lines(page.text);
    for (std::size_t i = 0; i < lines.size(); ++i)
      for (const std::string& path : PathsOf(lines[i]))
        if (!Exists(files, path)) out.push_back(At(page, i, "there is no " + path));
  }
  return out;
}

bool IsCapital(const std::string& text, std::size_t at) {
  return at < text.size() && text[at] >= 'A' && text[at] <= 'Z';
}

// The quoted words of a line: texts in backquotes, up to a parenthesis, that consist of word
// characters, points and colons.
std::vector<std::string> QuotedWordsOf(const std::string& line) {
  std::vector<std::string> words;
  for (std::size_t open = line.find('`'); open != std::string::npos;) {
    const std::size_t close = line.find('`', open + 1);
    if (close == std::string::npos) break;
    std::string word = line.substr(open + 1, close - open - 1);
    word = word.substr(0, word.find('('));
    const bool is_plain = std::all_of(word.begin(), word.end(), [](char c) {
      return IsWordCharacter(c) || c == ':' || c == '.';
    });
    if (is_plain && !word.empty()) words.push_back(std::move(word));
    open = line.find('`', close + 1);
  }
  return words;
}

// Names of functions and types: quoted words that begin with a capital, in parts joined by `::`.
std::vector<std::string> NamesOf(const std::string& line) {
  std::vector<std::string> names;
  for (const std::string& word : QuotedWordsOf(line)) {
    const bool has_small =
        std::any_of(word.begin(), word.end(), [](char c) { return c >= 'a' && c <= 'z'; });
    if (IsCapital(word, 0) && has_small && word.find('.') == std::string::npos)
      names.push_back(word);
  }
  return names;
}

// Whether the text has `word(`, or `word` behind struct, class or using.
bool Declares(const std::string& text, const std::string& word) {
  for (std::size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if (at > 0 && IsWordCharacter(text[at - 1])) continue;
    if (end < text.size() && IsWordCharacter(text[end])) continue;
    if (end < text.size() && text[end] == '(') return true;
    for (const std::string_view before : {"struct ", "class ", "using "})
      if (at >= before.size() && text.compare(at - before.size(), before.size(), before) == 0)
        return true;
  }
  return false;
}

bool DeclaresAllParts(const std::string& text, const std::string& name) {
  for (std::size_t begin = 0; begin < name.size();) {
    const std::size_t end = std::min(name.find("::", begin), name.size());
    if (!Declares(text, name.substr(begin, end - begin))) return false;
    begin = end + 2;
  }
  return true;
}

// The code of a file without its comments: a name that only a comment has is not declared.
std::string CodeOf(const File& file) {
  std::string code;
  for (const SplitLine& line : SplitLines(file.text)) code += line.code + "\n";
  return code;
}

// A block is a row of a table, or the lines of a paragraph joined.
std::vector<std::pair<std::size_t, std::string>> BlocksOf(const File& page) {
  std::vector<std::pair<std::size_t, std::string>> blocks;
  bool joins = false;
  const auto lines = Lines(page.text);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const bool is_row = StartsWith(lines[i], "|");
    const bool is_item = StartsWith(lines[i], "- ");
    if (joins && !lines[i].empty() && !is_row && !is_item)
      blocks.back().second += " " + lines[i];
    else if (!lines[i].empty())
      blocks.emplace_back(i, lines[i]);
    joins = !lines[i].empty() && !is_row;
  }
  return blocks;
}

Complaints WaysNameFunctionsThatExist(const Files& files) {
  Complaints out;
  for (const File& page : files) {
    if (std::find(std::begin(kWays), std::end(kWays), page.path) == std::end(kWays)) continue;
    for (const auto& [line, block] : BlocksOf(page)) {
      const auto paths = PathsOf(block);
      for (const std::string& name : NamesOf(block)) {
        const bool declared = std::any_of(files.begin(), files.end(), [&](const File& file) {
          return std::find(paths.begin(), paths.end(), file.path) != paths.end() &&
                 DeclaresAllParts(CodeOf(file), name);
        });
        if (!declared) out.push_back(At(page, line, "no file beside it declares " + name));
      }
    }
  }
  return out;
}

// Names of all tests, as Suite.Name.
std::set<std::string> TestsOf(const Files& files) {
  std::set<std::string> tests;
  for (const File& file : files) {
    if (!EndsWith(file.path, ".cc")) continue;
    for (std::size_t at = file.text.find("TEST"); at != std::string::npos;
         at = file.text.find("TEST", at + 1)) {
      const std::size_t open = file.text.find('(', at);
      const std::size_t close = file.text.find(')', at);
      if (open > at + 6 || close == std::string::npos || open > close) continue;
      std::string name;
      for (const char c : file.text.substr(open + 1, close - open - 1)) {
        if (IsWordCharacter(c)) name += c;
        if (c == ',') name += '.';
      }
      tests.insert(name);
    }
  }
  return tests;
}

// Words in backquotes of the form Suite.Name, or .Name for the suite before it.
Complaints PagesNameTestsThatExist(const Files& files) {
  const std::set<std::string> tests = TestsOf(files);
  Complaints out;
  for (const File& page : files) {
    if (!StartsWith(page.path, "docs/")) continue;
    std::string suite;
    const auto lines = Lines(page.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (const std::string& word : QuotedWordsOf(lines[i])) {
        const std::size_t dot = word.find('.');
        if (dot == std::string::npos || !IsCapital(word, dot + 1)) continue;
        if (dot != 0 && !IsCapital(word, 0)) continue;
        if (dot != 0) suite = word.substr(0, dot);
        const std::string test = suite + word.substr(dot);
        if (tests.count(test) == 0) out.push_back(At(page, i, "there is no test " + test));
      }
    }
  }
  return out;
}

// The cells of a row of a table, without blanks around them.
std::vector<std::string> CellsOf(const std::string& line) {
  std::vector<std::string> cells;
  for (std::size_t begin = 1; begin < line.size();) {
    const std::size_t end = std::min(line.find('|', begin), line.size());
    const std::size_t first = line.find_first_not_of(' ', begin);
    std::string cell = line.substr(std::min(first, end), end - std::min(first, end));
    while (EndsWith(cell, " ")) cell.pop_back();
    cells.push_back(std::move(cell));
    begin = end + 1;
  }
  return cells;
}

// Texts in backquotes.
std::vector<std::string> QuotesOf(const std::string& text) {
  std::vector<std::string> quotes;
  for (std::size_t open = text.find('`'); open != std::string::npos;) {
    const std::size_t close = text.find('`', open + 1);
    if (close == std::string::npos) break;
    quotes.push_back(text.substr(open + 1, close - open - 1));
    open = text.find('`', close + 1);
  }
  return quotes;
}

// A fault of the matrix has an id of its own, and may go over several rows. The last cells name its
// tests: as Suite.Name, or by the path of a file.
Complaints FaultsHaveTests(const Files& files) {
  const std::set<std::string> tests = TestsOf(files);
  Complaints out;
  for (const File& page : files) {
    if (page.path != kFaultMatrix) continue;
    std::set<std::string> ids;
    bool has_test = true;  // the last fault
    const auto lines = Lines(page.text);
    for (std::size_t i = 0; i <= lines.size(); ++i) {
      const bool is_row = i < lines.size() && StartsWith(lines[i], "| ");
      const auto cells = is_row ? CellsOf(lines[i]) : std::vector<std::string>{"id"};
      if (!cells.front().empty()) {
        if (!std::exchange(has_test, true))
          out.push_back(At(page, i, "the fault above has no test"));
        if (cells.front() == "id") continue;
        has_test = false;
        if (!ids.insert(cells.front()).second)
          out.push_back(At(page, i, "there are two faults " + cells.front()));
      }
      if (cells.size() != 4) out.push_back(At(page, i, "a row has id, fault, response and tests"));
      for (const std::string& test : QuotesOf(cells.back())) {
        has_test = true;
        if (tests.count(test) == 0 && !(StartsWith(test, "tests/") && Exists(files, test)))
          out.push_back(At(page, i, "there is no test " + test));
      }
    }
  }
  return out;
}

// A test in backquotes: Suite.Name, also behind the name of its parameters, a file under tests/, or
// a name that a CMakeLists.txt gives to ctest.
bool IsTest(const Files& files, const std::set<std::string>& tests, const std::string& quote) {
  if (tests.count(quote.substr(quote.find('/') + 1)) != 0) return true;
  if (StartsWith(quote, "tests/")) return Exists(files, quote);
  return std::any_of(files.begin(), files.end(), [&](const File& file) {
    return EndsWith(file.path, "CMakeLists.txt") && ContainsWord(file.text, "NAME " + quote);
  });
}

// Each row of a table whose last column is `tests` names its tests.
Complaints AttacksHaveTests(const Files& files) {
  const std::set<std::string> tests = TestsOf(files);
  Complaints out;
  for (const File& page : files) {
    if (page.path != kThreatModel) continue;
    bool wants_tests = false;
    const auto lines = Lines(page.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!StartsWith(lines[i], "|")) wants_tests = false;
      if (!StartsWith(lines[i], "| ")) continue;
      const auto cells = CellsOf(lines[i]);
      if (!std::exchange(wants_tests, wants_tests || cells.back() == "tests")) continue;
      const auto quotes = QuotesOf(cells.back());
      if (quotes.empty()) out.push_back(At(page, i, "the attack has no test"));
      for (const std::string& quote : quotes)
        if (!IsTest(files, tests, quote)) out.push_back(At(page, i, "there is no test " + quote));
    }
  }
  return out;
}

// The targets of a page's links within the repository, from its root. A folder ends with `/`.
std::vector<std::string> LinksOf(const File& page) {
  std::vector<std::string> links;
  const std::string folder = page.path.substr(0, page.path.rfind('/') + 1);
  for (std::size_t at = page.text.find("]("); at != std::string::npos;
       at = page.text.find("](", at + 2)) {
    const std::size_t end = page.text.find_first_of(")# \n", at + 2);
    if (end == std::string::npos) break;
    const std::string target = page.text.substr(at + 2, end - at - 2);
    if (target.empty() || target.find("://") != std::string::npos) continue;
    links.push_back(std::filesystem::path(folder + target).lexically_normal().generic_string());
  }
  return links;
}

// The pages that a link opens: the page itself, or those that a folder lists.
std::vector<const File*> OpenedBy(const Files& files, const std::string& link) {
  std::vector<const File*> pages;
  for (const File& file : files) {
    const bool listed = EndsWith(link, "/") && StartsWith(file.path, link);
    if (EndsWith(file.path, ".md") && (file.path == link || listed)) pages.push_back(&file);
  }
  return pages;
}

// A reader comes from README.md to each page of docs/ by two links at most.
Complaints PagesAreTwoLinksAway(const Files& files) {
  std::set<std::string> reached = {"README.md"};
  std::vector<const File*> last = OpenedBy(files, "README.md");
  for (int links = 0; links < 2; ++links) {
    std::vector<const File*> next;
    for (const File* page : last)
      for (const std::string& link : LinksOf(*page))
        for (const File* opened : OpenedBy(files, link))
          if (reached.insert(opened->path).second) next.push_back(opened);
    last = std::move(next);
  }
  Complaints out;
  for (const File& page : files)
    if (StartsWith(page.path, "docs/") && EndsWith(page.path, ".md") &&
        reached.count(page.path) == 0)
      out.push_back(page.path + ": more than two links away from README.md");
  return out;
}

Complaints WaysAreThere(const Files& files) {
  Complaints out;
  for (const std::string_view way : kWays)
    if (!Exists(files, std::string(way))) out.push_back("there is no " + std::string(way));
  return out;
}

TEST(Tidy, PagesNameFilesThatExist) { ExpectNone(PagesNameFilesThatExist(Tree())); }
TEST(Tidy, WaysNameFunctionsThatExist) {
  ExpectNone(WaysAreThere(Tree()));
  ExpectNone(WaysNameFunctionsThatExist(Tree()));
}

TEST(Tidy, PagesAreTwoLinksAway) { ExpectNone(PagesAreTwoLinksAway(Tree())); }
TEST(Tidy, PagesNameTestsThatExist) { ExpectNone(PagesNameTestsThatExist(Tree())); }

TEST(Tidy, FaultsHaveTests) {
  EXPECT_TRUE(Exists(Tree(), std::string(kFaultMatrix)));
  ExpectNone(FaultsHaveTests(Tree()));
}

TEST(Tidy, AttacksHaveTests) {
  EXPECT_TRUE(Exists(Tree(), std::string(kThreatModel)));
  ExpectNone(AttacksHaveTests(Tree()));
}

TEST(TidyRules, AttacksWithoutTestsAreCaught) {
  const auto complaints = [](const std::string& row) {
    return AttacksHaveTests({{"docs/threat-model.md",
                              "| id | who |\n|---|---|\n| A1 | x |\n\n"
                              "| attack | response | tests |\n|---|---|---|\n" +
                                  row},
                             {"tests/a_test.cc", "TEST_P(Door, Holds) {}\n"},
                             {"tests/can/far", ""},
                             {"tests/CMakeLists.txt", "add_test(NAME shell.door COMMAND x)\n"}})
        .size();
  };
  EXPECT_EQ(complaints("| a | b | `Door.Holds`, `All/Door.Holds`, `shell.door` |\n"), 0u);
  EXPECT_EQ(complaints("| a | b | `tests/can/far` |\n"), 0u);
  EXPECT_EQ(complaints("| a | b | `Door.Hold`, `shell.doo`, `tests/can/fa` |\n"), 3u);
  EXPECT_EQ(complaints("| a | b | |\n| a | `Door.Holds` | c |\n"), 2u);
}

TEST(TidyRules, FaultsWithoutTestsAreCaught) {
  const auto complaints = [](const std::string& rows) {
    const std::string head = "| id | fault | response | tests |\n|---|---|---|---|\n";
    return FaultsHaveTests({{"docs/fault-matrix.md", head + rows},
                            {"tests/a_test.cc", "TEST(Bus, Stops) {}\n"},
                            {"tests/can/sick-buses", ""}})
        .size();
  };
  EXPECT_EQ(complaints("| C1 | off | restarted | `Bus.Stops`, `tests/can/sick-buses` |\n"), 0u);
  EXPECT_EQ(complaints("| C1 | off | restarted | `Bus.Stop` |\n"), 1u);
  EXPECT_EQ(complaints("| C1 | off | restarted | `tests/can/sick-bus` |\n"), 1u);
  EXPECT_EQ(complaints("| C1 | off | restarted | `docs/fault-matrix.md` |\n"), 1u) << "no test";
  EXPECT_EQ(complaints("| C1 | off | restarted | Bus.Stops |\n"), 1u) << "without backquotes";
  EXPECT_EQ(complaints("| C1 | a | b | `Bus.Stops` |\n| C1 | a | b | `Bus.Stops` |\n"), 1u);
  EXPECT_EQ(complaints("| C1 | a | b | |\n| | | | `Bus.Stops` |\n"), 0u);
  EXPECT_EQ(complaints("| C1 | a | b | |\n\n| C2 | a | b | `Bus.Stops` |\n"), 1u);
  EXPECT_EQ(complaints("| C1 | a | b |\n"), 2u);
}

TEST(TidyRules, PagesThatAreFarAreCaught) {
  const auto complaints = [](const std::string& index) {
    return PagesAreTwoLinksAway({{"README.md", "[pages](docs/README.md#all)\n"},
                                 {"docs/README.md", index},
                                 {"docs/a.md", "[next](b.md)\n"},
                                 {"docs/b.md", ""},
                                 {"docs/adr/1.md", ""}})
        .size();
  };
  EXPECT_EQ(complaints("[a](a.md), [b](../docs/b.md), [adr](adr/)\n"), 0u);
  EXPECT_EQ(complaints("[a](a.md), [adr](adr/)\n"), 1u) << "three links to b";
  EXPECT_EQ(complaints("[a](a.md), [b](https://b.md), `b.md`, [adr](adr/1.md)\n"), 1u);
}

TEST(TidyRules, TestsThatDoNotExistAreCaught) {
  const auto complaints = [](const std::string& text) {
    const std::string tests = "TEST(Bus, Stops) {}\nTEST_F(BusFixture,\n       Starts) {}\n";
    return PagesNameTestsThatExist({{"docs/a.md", text}, {"tests/a_test.cc", tests}}).size();
  };
  EXPECT_EQ(complaints("`Bus.Stops`, `BusFixture.Starts`\n"), 0u);
  EXPECT_EQ(complaints("`Bus.Stops`,\n`.Starts`\n"), 1u) << "of the suite before it";
  EXPECT_EQ(complaints("`Bus.Goes`, `bus.Goes`, `Bus.goes`, `Bus.Goes*`\n"), 1u);
}

TEST(TidyRules, FilesThatDoNotExistAreCaught) {
  const auto complaints = [](const std::string& text) {
    return PagesNameFilesThatExist({{"docs/a.md", text}, {"fleet/plan/plan.h", ""}}).size();
  };
  EXPECT_EQ(complaints("See fleet/plan/plan.h.\n"), 0u);
  EXPECT_EQ(complaints("See `fleet/plan/` and docs/a.md\n"), 0u);
  EXPECT_EQ(complaints("See fleet/plan/plane.h.\n"), 1u);
  EXPECT_EQ(complaints("| a | fleet/plans/, docs/b.md |\n"), 2u);
  EXPECT_EQ(complaints("A topic focalfleet/exposure, a folder build/bin\n"), 0u);
}

TEST(TidyRules, FunctionsThatDoNotExistAreCaught) {
  const auto complaints = [](const std::string& text) {
    const std::string header =
        "/// As Apply(2).\nclass Executor {\n  Status Begin(int goal);\n};\nstruct Plan {};\n";
    return WaysNameFunctionsThatExist({{"docs/way_of_a_move.md", text}, {"fleet/e.h", header}})
        .size();
  };
  EXPECT_EQ(complaints("| `Plan` | `Executor::Begin` | fleet/e.h |\n"), 0u);
  EXPECT_EQ(complaints("| `Begin(goal)` | fleet/e.h | `done`, `x.csv` |\n"), 0u);
  EXPECT_EQ(complaints("`Begin` of\nfleet/e.h begins.\n"), 0u) << "a paragraph";
  EXPECT_EQ(complaints("| `Executor::Starts` | fleet/e.h |\n"), 1u) << "a wrong function";
  EXPECT_EQ(complaints("| `Executer::Begin` | fleet/e.h |\n"), 1u) << "a wrong class";
  EXPECT_EQ(complaints("| `Apply` | fleet/e.h |\n"), 1u) << "only a comment has it";
  EXPECT_EQ(complaints("| `Begin` | fleet/f.h |\n"), 1u) << "another file";
  EXPECT_EQ(complaints("| `Begin` | |\n"), 1u) << "no file";
}

}  // namespace
}  // namespace focalfleet::tidy
