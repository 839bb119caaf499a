// The rules of the house that no compiler knows, over every file of the repository in milliseconds:
// who may include whom, what a pure folder may not touch, and what must not be left lying about. A
// rule is a row of a table; each rule is tried on planted violations first.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace focalfleet {
namespace {

namespace fs = std::filesystem;

struct File {
  std::string path;  // from the repository's root, with '/'
  std::string text;
};
using Files = std::vector<File>;
using Complaints = std::vector<std::string>;

// ---- the tables

struct Direction {
  std::string_view from;  // a path prefix; the first row that fits decides
  std::vector<std::string_view> may_include;
};

const std::vector<Direction>& Directions() {
  static const std::vector<Direction> table = {
      {"protocol/", {"protocol/"}},
      {"fleet/", {"protocol/", "fleet/"}},
      {"sim/", {"protocol/", "sim/"}},
      {"daemon/", {"protocol/", "fleet/", "sim/", "daemon/"}},
      // Plants effects with physics of its own; with the simulator's it would test the diagnosis
      // against itself.
      {"tests/hidden/", {"protocol/", "tests/hidden/", "tests/support/"}},
      {"tests/", {"protocol/", "fleet/", "sim/", "daemon/", "tests/"}},
  };
  return table;
}

struct Ban {
  std::string_view word;  // as a whole word
  std::string_view why;
};

constexpr Ban kBannedInPureFolders[] = {
    {"system_clock", "a clock: `now` is an argument"},
    {"steady_clock", "a clock: `now` is an argument"},
    {"high_resolution_clock", "a clock: `now` is an argument"},
    {"clock_gettime", "a clock: `now` is an argument"},
    {"gettimeofday", "a clock: `now` is an argument"},
    {"<chrono>", "a clock: `now` is an argument"},
    {"<ctime>", "a clock: `now` is an argument"},
    {"<thread>", "a thread: heavy work takes an injected ParallelFor"},
    {"<mutex>", "a thread: the core is single-threaded"},
    {"<atomic>", "a thread: the core is single-threaded"},
    {"<future>", "a thread: the core is single-threaded"},
    {"<condition_variable>", "a thread: the core is single-threaded"},
    {"thread_local", "global state"},
    {"<fstream>", "a file"},
    {"<filesystem>", "a file"},
    {"fopen", "a file"},
    {"<iostream>", "the terminal: return values instead"},
    {"spdlog", "a log: return events instead"},
    {"<sys/socket.h>", "a socket"},
    {"<unistd.h>", "a system call"},
    {"<fcntl.h>", "a system call"},
    {"<sys/epoll.h>", "a system call"},
    {"<linux/can.h>", "a system call"},
    {"<random>", "distributions differ between libraries: protocol/base/rng.h"},
    {"random_device", "chance is an argument: protocol/base/rng.h"},
    {"rand", "chance is an argument: protocol/base/rng.h"},
    {"srand", "chance is an argument: protocol/base/rng.h"},
    {"drand48", "chance is an argument: protocol/base/rng.h"},
    {"getenv", "the environment: configuration is an argument"},
    {"throw", "own code does not throw: Result<T>"},
};

constexpr std::string_view kPureFolders[] = {"protocol/", "fleet/", "sim/"};

constexpr std::size_t kLineLengthMax = 100;

// ---- small things

bool StartsWith(std::string_view text, std::string_view prefix) {
  return text.substr(0, prefix.size()) == prefix;
}
bool EndsWith(std::string_view text, std::string_view suffix) {
  return text.size() >= suffix.size() && text.substr(text.size() - suffix.size()) == suffix;
}
bool IsCode(std::string_view path) {
  return EndsWith(path, ".h") || EndsWith(path, ".cc") || EndsWith(path, ".c");
}
bool IsPure(std::string_view path) {
  return std::any_of(std::begin(kPureFolders), std::end(kPureFolders),
                     [&](std::string_view folder) { return StartsWith(path, folder); });
}

std::vector<std::string> Lines(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

std::string At(const File& file, std::size_t line, std::string_view what) {
  return file.path + ":" + std::to_string(line + 1) + ": " + std::string(what);
}

bool IsWordCharacter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
}
bool ContainsWord(std::string_view line, std::string_view word) {
  for (std::size_t at = line.find(word); at != std::string_view::npos;
       at = line.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    const bool begins = at == 0 || !IsWordCharacter(line[at - 1]) || !IsWordCharacter(word.front());
    const bool ends =
        end == line.size() || !IsWordCharacter(line[end]) || !IsWordCharacter(word.back());
    if (begins && ends) return true;
  }
  return false;
}

// The code of each line: comments and the contents of string literals blanked, except in #include
// lines.
std::vector<std::string> CodeLines(const std::string& text) {
  std::vector<std::string> out;
  bool in_block = false;
  for (const std::string& line : Lines(text)) {
    std::string code;
    char quote = 0;
    const bool include = line.find("#include") != std::string::npos;
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::string_view rest{line.data() + i, line.size() - i};
      if (in_block) {
        if (StartsWith(rest, "*/")) in_block = false, ++i;
      } else if (quote != 0) {
        if (line[i] == '\\')
          ++i;
        else if (line[i] == quote)
          quote = 0;
      } else if (StartsWith(rest, "//")) {
        break;
      } else if (StartsWith(rest, "/*")) {
        in_block = true, ++i;
      } else if (!include && (line[i] == '"' ||
                              (line[i] == '\'' && (i == 0 || !IsWordCharacter(line[i - 1]))))) {
        quote = line[i];
      } else {
        code += line[i];
      }
    }
    out.push_back(code);
  }
  return out;
}

std::string QuotedInclude(const std::string& line) {
  const std::size_t hash = line.find("#include \"");
  if (hash == std::string::npos) return "";
  const std::size_t begin = hash + std::string_view("#include \"").size();
  return line.substr(begin, line.find('"', begin) - begin);
}

// ---- the rules

Complaints IncludeDirection(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!IsCode(file.path)) continue;
    const auto row =
        std::find_if(Directions().begin(), Directions().end(),
                     [&](const Direction& d) { return StartsWith(file.path, d.from); });
    if (row == Directions().end()) continue;
    const auto lines = CodeLines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::string include = QuotedInclude(lines[i]);
      if (include.empty()) continue;
      const bool generated = include.find('/') == std::string::npos;  // beside the sources of idlc
      if (generated && !IsPure(file.path)) continue;
      const bool allowed =
          std::any_of(row->may_include.begin(), row->may_include.end(),
                      [&](std::string_view folder) { return StartsWith(include, folder); });
      if (!allowed)
        out.push_back(At(file, i, std::string(row->from) + " must not include " + include));
    }
  }
  return out;
}

// A variable at namespace scope stands at the left edge, and neither constant nor a function nor a
// type.
bool LooksLikeMutableGlobal(const std::string& line) {
  if (line.empty() || !(IsWordCharacter(line[0]))) return false;
  if (line.back() != ';') return false;
  for (const std::string_view word :
       {"constexpr", "const", "consteval", "constinit", "using",         "typedef",  "class",
        "struct",    "enum",  "namespace", "template",  "static_assert", "friend",   "extern",
        "return",    "union", "concept",   "public",    "private",       "protected"})
    if (ContainsWord(line, word)) return false;
  if (line.find('(') != std::string::npos) return false;
  return line.find(' ') != std::string::npos;
}

Complaints PureFoldersArePure(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!IsCode(file.path) || !IsPure(file.path)) continue;
    const auto lines = CodeLines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (const Ban& ban : kBannedInPureFolders)
        if (ContainsWord(lines[i], ban.word))
          out.push_back(At(file, i, std::string(ban.word) + " is " + std::string(ban.why)));
      const std::size_t first = lines[i].find_first_not_of(' ');
      const std::string trimmed = first == std::string::npos ? "" : lines[i].substr(first);
      const bool is_static = StartsWith(trimmed, "static ") && trimmed.back() == ';' &&
                             trimmed.find('(') == std::string::npos &&
                             !ContainsWord(trimmed, "const") && !ContainsWord(trimmed, "constexpr");
      if (is_static || LooksLikeMutableGlobal(lines[i]))
        out.push_back(At(file, i, "mutable state outlives its function: " + trimmed));
    }
  }
  return out;
}

Complaints TextIsClean(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!file.text.empty() && file.text.back() != '\n')
      out.push_back(At(file, 0, "the file does not end with a newline"));
    if (EndsWith(file.text, "\n\n")) out.push_back(At(file, 0, "the file ends with empty lines"));
    const auto lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].find('\t') != std::string::npos) out.push_back(At(file, i, "a tab"));
      if (lines[i].find('\r') != std::string::npos) out.push_back(At(file, i, "a carriage return"));
      if (!lines[i].empty() && lines[i].back() == ' ') out.push_back(At(file, i, "trailing space"));
      const auto bytes =
          static_cast<std::size_t>(std::count_if(lines[i].begin(), lines[i].end(), [](char c) {
            return (static_cast<unsigned char>(c) & 0xC0u) != 0x80u;
          }));
      if (IsCode(file.path) && bytes > kLineLengthMax)
        out.push_back(At(file, i, "longer than 100 columns"));
    }
  }
  return out;
}

Complaints NothingIsLeftOver(const Files& files) {
  // Written in halves, so that this file does not complain about itself.
  const std::string todo = std::string("TO") + "DO";
  const std::string fixme = std::string("FIX") + "ME";
  const std::string machine_paths[] = {std::string("/wo") + "rk/", std::string("shared") + "/",
                                       std::string("/ho") + "me/", std::string("/ro") + "ot/"};
  // Measured data may lie beside a checkout; only CMake looks for it, relative to the project.
  const std::string beside_the_checkout = "${PROJECT_SOURCE_DIR}/../" + machine_paths[1] + "data";
  Complaints out;
  for (const File& file : files) {
    const auto lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (EndsWith(file.path, "CMakeLists.txt") &&
          lines[i].find(beside_the_checkout) != std::string::npos)
        continue;
      const std::size_t at = lines[i].find(todo);
      if (ContainsWord(lines[i], todo) && lines[i].compare(at + 4, 2, "(#") != 0)
        out.push_back(At(file, i, todo + " without an issue number"));
      if (ContainsWord(lines[i], fixme)) out.push_back(At(file, i, fixme));
      for (const std::string& path : machine_paths)
        if (lines[i].find(path) != std::string::npos)
          out.push_back(At(file, i, "a path of one machine: " + path));
    }
    if (ContainsWord(file.path, "utils") || ContainsWord(file.path, "util") ||
        ContainsWord(file.path, "helpers") || ContainsWord(file.path, "common"))
      out.push_back(file.path + ": a name that says nothing; name what it does");
  }
  return out;
}

Complaints HeadersGuardThemselves(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!EndsWith(file.path, ".h")) continue;
    const auto lines = Lines(file.text);
    const bool guarded = std::find(lines.begin(), lines.end(), "#pragma once") != lines.end();
    if (!guarded) out.push_back(file.path + ": no #pragma once");
    if (!IsPure(file.path) && !StartsWith(file.path, "daemon/")) continue;
    if (!StartsWith(file.text, "//"))
      out.push_back(file.path + ": a header opens with its idea, as a comment");
  }
  return out;
}

// The words of a CMakeLists.txt: what stands between blanks, quotes and parentheses.
std::vector<std::string> CMakeWords(const std::string& text) {
  std::vector<std::string> words(1);
  for (const std::string& line : Lines(text)) {
    for (const char c : line.substr(0, line.find('#'))) {
      const bool separates = std::string_view(" ()\"").find(c) != std::string_view::npos;
      if (!separates) words.back() += c;
      if (separates && !words.back().empty()) words.emplace_back();
    }
    words.emplace_back();
  }
  return words;
}

void ReplacePrefix(std::string* text, std::string_view prefix, const std::string& by) {
  if (StartsWith(*text, prefix)) *text = by + text->substr(prefix.size());
}

// Files that a CMakeLists.txt names, from the repository's root. `${program}.c` of a foreach stands
// for every word of the file with that ending.
std::set<std::string> FilesNamedBy(const File& list) {
  const std::string folder = list.path.substr(0, list.path.rfind('/') + 1);
  const auto words = CMakeWords(list.text);
  std::set<std::string> named;
  const auto add = [&](std::string word) {
    ReplacePrefix(&word, "${CMAKE_CURRENT_SOURCE_DIR}/", "");
    const bool from_root = StartsWith(word, "${PROJECT_SOURCE_DIR}/");
    ReplacePrefix(&word, "${PROJECT_SOURCE_DIR}/", "");
    named.insert(fs::path((from_root ? "" : folder) + word).lexically_normal().generic_string());
  };
  for (const std::string& word : words) {
    add(word);
    const std::size_t brace = word.find('}');
    if (!StartsWith(word, "${") || brace == std::string::npos || word[brace + 1] != '.') continue;
    for (const std::string& stem : words) add(stem + word.substr(brace + 1));
  }
  return named;
}

// Explicit file lists mean that a forgotten file is neither built nor tested: every source, and
// every header of a library, stands in a CMakeLists.txt.
Complaints EverySourceIsBuilt(const Files& files) {
  std::set<std::string> named;
  for (const File& list : files)
    if (EndsWith(list.path, "/CMakeLists.txt")) named.merge(FilesNamedBy(list));
  Complaints out;
  for (const File& file : files) {
    const bool source = EndsWith(file.path, ".cc") || EndsWith(file.path, ".c");
    const bool library_header = EndsWith(file.path, ".h") && IsPure(file.path);
    if ((source || library_header) && named.count(file.path) == 0)
      out.push_back(file.path + ": stands in no CMakeLists.txt");
  }
  return out;
}

Complaints FoldersExplainThemselves(const Files& files) {
  std::set<std::string> folders;
  std::set<std::string> readmes;
  for (const File& file : files) {
    const std::size_t slash = file.path.find('/');
    if (slash == std::string::npos || file.path[0] == '.') continue;
    folders.insert(file.path.substr(0, slash));
    if (file.path == file.path.substr(0, slash) + "/README.md")
      readmes.insert(file.path.substr(0, slash));
  }
  Complaints out;
  for (const std::string& folder : folders)
    if (readmes.count(folder) == 0) out.push_back(folder + ": no README.md");
  return out;
}

// ---- the repository

Files Repository() {
  Files files;
  const fs::path root = FOCALFLEET_SOURCE_DIR;
  const std::set<std::string> folders = {"protocol", "fleet",  "sim",  "daemon",
                                         "tests",    "deploy", "docs", ".ci"};
  const auto read = [&](const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    std::string text((std::istreambuf_iterator<char>(in)), {});
    if (text.find('\0') != std::string::npos) return;  // a picture, a corpus file
    files.push_back({fs::relative(path, root).generic_string(), std::move(text)});
  };
  for (const auto& top : fs::directory_iterator(root)) {
    const std::string name = top.path().filename().string();
    if (top.is_regular_file()) read(top.path());
    if (!top.is_directory() || folders.count(name) == 0) continue;
    for (const auto& entry : fs::recursive_directory_iterator(top.path())) {
      const bool data = entry.path().string().find("/corpus/") != std::string::npos ||
                        entry.path().string().find("/data/") != std::string::npos;
      if (entry.is_regular_file() && !data) read(entry.path());
    }
  }
  return files;
}

void ExpectNone(const Complaints& complaints) {
  for (const std::string& complaint : complaints) ADD_FAILURE() << complaint;
}

const Files& Tree() {
  static const Files files = Repository();
  return files;
}

TEST(Tidy, SeesTheRepository) {
  EXPECT_GT(Tree().size(), 40u);
  EXPECT_TRUE(std::any_of(Tree().begin(), Tree().end(),
                          [](const File& f) { return f.path == "protocol/wire/codec.cc"; }));
}
TEST(Tidy, IncludesFollowTheDependencyDirection) { ExpectNone(IncludeDirection(Tree())); }
TEST(Tidy, PureFoldersArePure) { ExpectNone(PureFoldersArePure(Tree())); }
TEST(Tidy, TextIsClean) { ExpectNone(TextIsClean(Tree())); }
TEST(Tidy, NothingIsLeftOver) { ExpectNone(NothingIsLeftOver(Tree())); }
TEST(Tidy, HeadersGuardThemselves) { ExpectNone(HeadersGuardThemselves(Tree())); }
TEST(Tidy, EverySourceIsBuilt) { ExpectNone(EverySourceIsBuilt(Tree())); }
TEST(Tidy, FoldersExplainThemselves) { ExpectNone(FoldersExplainThemselves(Tree())); }

// ---- the rules, tried on planted violations

using Rule = Complaints (*)(const Files&);

std::size_t Found(Rule rule, std::string path, std::string text) {
  return rule({{std::move(path), std::move(text)}}).size();
}

TEST(TidyRules, DirectionIsCaughtBothWays) {
  const auto include = [](const char* from, const std::string& what) {
    return Found(IncludeDirection, from, "#include \"" + what + "\"\n");
  };
  EXPECT_EQ(include("protocol/a.h", "fleet/layout.h"), 1u);
  EXPECT_EQ(include("fleet/a.cc", "sim/world/world.h"), 1u);
  EXPECT_EQ(include("fleet/a.cc", "daemon/store/store.h"), 1u);
  EXPECT_EQ(include("fleet/a.cc", "layout.h"), 1u) << "not by its path from the root";
  EXPECT_EQ(include("sim/a.cc", "fleet/layout.h"), 1u);
  EXPECT_EQ(include("sim/a.cc", "tests/support/seed.h"), 1u);
  EXPECT_EQ(include("daemon/a.cc", "tests/support/seed.h"), 1u);
  EXPECT_EQ(include("tests/hidden/a.cc", "sim/campaigns/effects/backlash.h"), 1u);
  EXPECT_EQ(include("tests/sim/a.cc", "sim/campaigns/effects/backlash.h"), 0u);
  EXPECT_EQ(include("fleet/a.cc", "protocol/base/ids.h"), 0u);
  EXPECT_EQ(include("daemon/a.cc", "sim/world/world.h"), 0u);
  EXPECT_EQ(include("daemon/dds/a.cc", "status.h"), 0u) << "generated";
  EXPECT_EQ(Found(IncludeDirection, "fleet/a.cc", "// #include \"sim/world/world.h\"\n"), 0u);
}

TEST(TidyRules, EveryBanIsCaughtInEveryPureFolder) {
  for (const Ban& ban : kBannedInPureFolders) {
    const std::string line = ban.word.front() == '<'
                                 ? "#include " + std::string(ban.word)
                                 : "  auto x = " + std::string(ban.word) + "(1);";
    for (const std::string_view folder : kPureFolders)
      EXPECT_EQ(Found(PureFoldersArePure, std::string(folder) + "a.cc", line + "\n"), 1u) << line;
    EXPECT_EQ(Found(PureFoldersArePure, "daemon/a.cc", line + "\n"), 0u) << line;
    EXPECT_EQ(Found(PureFoldersArePure, "fleet/a.cc", "  // " + line + "\n"), 0u) << line;
  }
  EXPECT_EQ(Found(PureFoldersArePure, "fleet/a.cc", "  int operand = strand;\n"), 0u)
      << "not a word";
  EXPECT_EQ(Found(PureFoldersArePure, "fleet/a.cc", "  Say(\"throw rand\");\n"), 0u) << "a text";
}

TEST(TidyRules, MutableGlobalsAreCaught) {
  const auto found = [](const std::string& line) {
    return Found(PureFoldersArePure, "sim/a.cc", line + "\n");
  };
  EXPECT_EQ(found("int counter = 0;"), 1u);
  EXPECT_EQ(found("std::vector<int> cache;"), 1u);
  EXPECT_EQ(found("static double last_seen{};"), 1u);
  EXPECT_EQ(found("inline int hits = 0;"), 1u);
  EXPECT_EQ(found("  static int calls = 0;"), 1u);
  EXPECT_EQ(found("constexpr int kLimit = 3;"), 0u);
  EXPECT_EQ(found("const int limit = 3;"), 0u);
  EXPECT_EQ(found("  static constexpr int kLimit = 3;"), 0u);
  EXPECT_EQ(found("struct Forward;"), 0u);
  EXPECT_EQ(found("using Pose = int;"), 0u);
  EXPECT_EQ(found("int Count(int x);"), 0u);
  EXPECT_EQ(found("  int local = 0;"), 0u);
}

TEST(TidyRules, UncleanTextIsCaught) {
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", "no newline"), 1u);
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", "two\n\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "\ttab\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "dos\r\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "space \n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", std::string(101, 'x') + "\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", std::string(100, 'x') + "\n"), 0u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "// " + std::string(96, 'x') + "\u00b0\n"), 0u)
      << "columns, not bytes";
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", std::string(300, 'x') + "\n"), 0u);
}

TEST(TidyRules, LeftoversAreCaught) {
  const auto found = [](const std::string& line) {
    return Found(NothingIsLeftOver, "fleet/a.cc", line + "\n");
  };
  EXPECT_EQ(found(std::string("// TO") + "DO: later"), 1u);
  EXPECT_EQ(found(std::string("// TO") + "DO(#12): later"), 0u);
  EXPECT_EQ(found(std::string("// FIX") + "ME"), 1u);
  EXPECT_EQ(found(std::string("see /wo") + "rk/x"), 1u);
  EXPECT_EQ(found(std::string("see shar") + "ed/x"), 1u);
  EXPECT_EQ(found(std::string("/ho") + "me/somebody"), 1u);
  EXPECT_EQ(Found(NothingIsLeftOver, "fleet/utils.h", ""), 1u);
  EXPECT_EQ(Found(NothingIsLeftOver, "fleet/common/a.h", ""), 1u);
}

TEST(TidyRules, BareHeadersAreCaught) {
  EXPECT_EQ(Found(HeadersGuardThemselves, "fleet/a.h", "// Idea.\n#pragma once\n"), 0u);
  EXPECT_EQ(Found(HeadersGuardThemselves, "fleet/a.h", "// Idea.\nint F();\n"), 1u);
  EXPECT_EQ(Found(HeadersGuardThemselves, "fleet/a.h", "#pragma once\n"), 1u) << "no idea";
  EXPECT_EQ(Found(HeadersGuardThemselves, "tests/a.h", "#pragma once\n"), 0u);
}

TEST(TidyRules, UnlistedSourcesAreCaught) {
  const auto found = [](const std::string& path, const std::string& list_path,
                        const std::string& list) {
    return EverySourceIsBuilt({{path, ""}, {list_path, list}}).size();
  };
  EXPECT_EQ(found("fleet/plan/a.cc", "fleet/CMakeLists.txt", "SOURCES plan/a.cc"), 0u);
  EXPECT_EQ(found("fleet/plan/a.cc", "fleet/CMakeLists.txt", "SOURCES plan/b.cc"), 1u);
  EXPECT_EQ(found("fleet/plan/a.cc", "fleet/CMakeLists.txt", "SOURCES a.cc"), 1u);
  EXPECT_EQ(found("fleet/a.cc", "fleet/CMakeLists.txt", "SOURCES data.cc"), 1u);
  EXPECT_EQ(found("fleet/a.cc", "sim/CMakeLists.txt", "SOURCES a.cc"), 1u);
  EXPECT_EQ(found("fleet/a.h", "fleet/CMakeLists.txt", "HEADERS b.h"), 1u);
  EXPECT_EQ(found("fleet/a.cc", "fleet/CMakeLists.txt", "SOURCES # a.cc"), 1u) << "a comment";
  EXPECT_EQ(found("tests/can/a.c", "tests/can/CMakeLists.txt", "add_executable(a a.c)"), 0u);
  EXPECT_EQ(found("tests/a/b.cc", "tests/c/CMakeLists.txt", "SOURCES ../a/b.cc"), 0u);
  EXPECT_EQ(found("tests/a/b.cc", "tests/c/CMakeLists.txt", "${PROJECT_SOURCE_DIR}/tests/a/b.cc"),
            0u);
  const char* loop = "foreach(x one two)\n  add_executable(${x} ${x}.c)\nendforeach()\n";
  EXPECT_EQ(found("tests/one.c", "tests/CMakeLists.txt", loop), 0u);
  EXPECT_EQ(found("tests/three.c", "tests/CMakeLists.txt", loop), 1u);
}

TEST(TidyRules, FoldersWithoutAReadmeAreCaught) {
  EXPECT_EQ(FoldersExplainThemselves({{"fleet/a.h", ""}}).size(), 1u);
  EXPECT_EQ(FoldersExplainThemselves({{"fleet/a.h", ""}, {"fleet/README.md", ""}}).size(), 0u);
  EXPECT_EQ(FoldersExplainThemselves({{"CMakeLists.txt", ""}, {".ci/run", ""}}).size(), 0u);
}

}  // namespace
}  // namespace focalfleet
