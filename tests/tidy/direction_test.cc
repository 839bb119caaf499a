// Three rules of direction: includes follow the table of layers, pure folders touch nothing
// outside, and the diagnosis knows no cause by its name.
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <string>
#include <string_view>
#include <vector>

#include "tests/tidy/repository.h"

namespace focalfleet::tidy {
namespace {

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

std::string QuotedInclude(const std::string& line) {
  const std::size_t hash = line.find("#include \"");
  if (hash == std::string::npos) return "";
  const std::size_t begin = hash + std::string_view("#include \"").size();
  return line.substr(begin, line.find('"', begin) - begin);
}

Complaints IncludeDirection(const Files& files) {
  Complaints out;
  for (const File& file : files) {
    if (!IsCode(file.path)) continue;
    const auto row =
        std::find_if(Directions().begin(), Directions().end(),
                     [&](const Direction& d) { return StartsWith(file.path, d.from); });
    if (row == Directions().end()) continue;
    const auto lines = SplitLines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      const std::string include = QuotedInclude(lines[i].code);
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

// The names of all causes: each effect has its own in its file, other_causes.h has the rest.
std::vector<std::string> CauseNames(const Files& files) {
  std::vector<std::string> names;
  const auto add_quoted = [&](const std::string& line, std::string_view before) {
    for (std::size_t at = line.find(before); at != std::string::npos;
         at = line.find(before, at + 1)) {
      const std::size_t begin = at + before.size();
      names.push_back(line.substr(begin, line.find('"', begin) - begin));
      // Empirical terms are no causes: they have no name to give.
      if (StartsWith(names.back(), "empirical_")) names.pop_back();
    }
  };
  for (const File& file : files) {
    if (!StartsWith(file.path, "sim/campaigns/effects/")) continue;
    for (const std::string& line : Lines(file.text)) {
      add_quoted(line, ".cause = \"");
      if (EndsWith(file.path, "other_causes.h")) add_quoted(line, "= \"");
    }
  }
  return names;
}

// A diagnosis that treats a cause by its name has a rule for one cause, and rules for one cause
// were tuned on one generator. Causes have traits (effects/traits.h).
Complaints DiagnosisKnowsNoName(const Files& files) {
  const std::vector<std::string> names = CauseNames(files);
  Complaints out;
  for (const File& file : files) {
    if (!StartsWith(file.path, "sim/campaigns/diagnosis/")) continue;
    const auto lines = Lines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i)
      for (const std::string& name : names)
        if (lines[i].find('"' + name + '"') != std::string::npos)
          out.push_back(At(file, i, "a cause by its name: " + name));
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
    const auto lines = SplitLines(file.text);
    for (std::size_t i = 0; i < lines.size(); ++i) {
      for (const Ban& ban : kBannedInPureFolders)
        if (ContainsWord(lines[i].code, ban.word))
          out.push_back(At(file, i, std::string(ban.word) + " is " + std::string(ban.why)));
      const std::size_t first = lines[i].code.find_first_not_of(' ');
      const std::string trimmed = first == std::string::npos ? "" : lines[i].code.substr(first);
      const bool is_static = StartsWith(trimmed, "static ") && trimmed.back() == ';' &&
                             trimmed.find('(') == std::string::npos &&
                             !ContainsWord(trimmed, "const") && !ContainsWord(trimmed, "constexpr");
      if (is_static || LooksLikeMutableGlobal(lines[i].code))
        out.push_back(At(file, i, "mutable state outlives its function: " + trimmed));
    }
  }
  return out;
}

TEST(Tidy, IncludesFollowTheDependencyDirection) { ExpectNone(IncludeDirection(Tree())); }
TEST(Tidy, PureFoldersArePure) { ExpectNone(PureFoldersArePure(Tree())); }
TEST(Tidy, TheDiagnosisKnowsNoCauseByItsName) {
  EXPECT_GE(CauseNames(Tree()).size(), 40u);
  ExpectNone(DiagnosisKnowsNoName(Tree()));
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

TEST(TidyRules, ACauseByItsNameIsCaught) {
  const File effect{"sim/campaigns/effects/wear.cc", "return {.cause = \"wear\",\n"};
  const auto found = [&](const std::string& path, const std::string& text) {
    return DiagnosisKnowsNoName({effect, {path, text}}).size();
  };
  EXPECT_EQ(found("sim/campaigns/diagnosis/a.cc", "if (cause == \"wear\") return;\n"), 1u);
  EXPECT_EQ(found("sim/campaigns/diagnosis/a.cc", "// wear grows\n"), 0u);
  EXPECT_EQ(found("sim/campaigns/planting/a.cc", "if (cause == \"wear\") return;\n"), 0u);
}

}  // namespace
}  // namespace focalfleet::tidy
