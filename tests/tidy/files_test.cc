// Rules of files: clean text, nothing left over, guarded headers, every source built, every folder
// explained.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tests/tidy/repository.h"

namespace focalfleet::tidy {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLineLengthMax = 100;

// The commands of a Makefile begin with tabs.
bool IsMakefile(std::string_view path) { return path == "deploy/debian/rules"; }

Complaints TextIsClean(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!file.text.empty() && file.text.back() != '\n')
      out.push_back(At(file, 0, "the file does not end with a newline"));
    if (EndsWith(file.text, "\n\n")) out.push_back(At(file, 0, "the file ends with empty lines"));
    const auto lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (!IsMakefile(file.path) && lines[i].find('\t') != std::string::npos)
        out.push_back(At(file, i, "a tab"));
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

TEST(Tidy, SeesTheRepository) {
  EXPECT_GT(Tree().size(), 40u);
  EXPECT_TRUE(std::any_of(Tree().begin(), Tree().end(),
                          [](const File& f) { return f.path == "protocol/wire/codec.cc"; }));
}
TEST(Tidy, TextIsClean) { ExpectNone(TextIsClean(Tree())); }
TEST(Tidy, NothingIsLeftOver) { ExpectNone(NothingIsLeftOver(Tree())); }
TEST(Tidy, HeadersGuardThemselves) { ExpectNone(HeadersGuardThemselves(Tree())); }
TEST(Tidy, EverySourceIsBuilt) { ExpectNone(EverySourceIsBuilt(Tree())); }
TEST(Tidy, FoldersExplainThemselves) { ExpectNone(FoldersExplainThemselves(Tree())); }

TEST(TidyRules, UncleanTextIsCaught) {
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", "no newline"), 1u);
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", "two\n\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "\ttab\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "deploy/debian/rules", "\ttab\n"), 0u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "dos\r\n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "space \n"), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", std::string(101, 'x').append("\n")), 1u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", std::string(100, 'x').append("\n")), 0u);
  EXPECT_EQ(Found(TextIsClean, "fleet/a.cc", "// " + std::string(96, 'x') + "\u00b0\n"), 0u)
      << "columns, not bytes";
  EXPECT_EQ(Found(TextIsClean, "docs/a.md", std::string(300, 'x').append("\n")), 0u);
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
}  // namespace focalfleet::tidy
