#include "daemon/cli/study_program.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {
namespace {

struct StudyName {
  const char* name;
  const char* what;
};

constexpr std::array<StudyName, 5> kStudyNames = {{
    {"simulate", "Simulate a motor or a measured campaign, no fleet"},
    {"diagnose", "Name what the simulation gets wrong about a measured campaign"},
    {"tune", "Find the n that motors need, always from rest"},
    {"reproduce", "Simulate what the drive's paper claims, claim by claim"},
    {"hall", "Orientation of ball joints without an encoder, from Hall sensors"},
}};

bool IsStudy(std::string_view word) {
  return std::ranges::any_of(kStudyNames, [&](const StudyName& each) { return word == each.name; });
}

/// The places where the program may be, the first that is taken first.
std::vector<std::filesystem::path> Places() {
  std::error_code failed;
  const auto folder = std::filesystem::read_symlink("/proc/self/exe", failed).parent_path();
  if (failed) return {};
  return {folder / "focalfleet-study",
          folder.parent_path() / "libexec" / "focalfleet" / "focalfleet-study"};
}

/// Returns an exit code where a study command is wanted and its program cannot be run (the reason
/// is on stderr), and none where the command is this program's.
std::optional<int> RunStudyProgram(int argc, char** argv) {
  const std::string word = CommandWord(argc, argv);
  const bool must = IsStudy(word);
  if (!must && word != "help" && word != "completion") return std::nullopt;
  int reason = ENOENT;
  for (const std::filesystem::path& place : Places()) {
    execv(place.c_str(), argv);  // returns only where it failed
    if (errno != ENOENT) reason = errno;
  }
  if (!must) return std::nullopt;
  Context context;
  context.LookAtTerminals();
  return static_cast<int>(Report(
      context,
      {ErrorCode::kUnavailable,
       fmt::format("{} is a command of the program focalfleet-study, which {} (looked for "
                   "beside focalfleet, and in ../libexec/focalfleet). In a clone "
                   "`deploy/build --study` builds it; the package focalfleet has it",
                   word,
                   reason == ENOENT ? std::string("is not installed")
                                    : fmt::format("cannot be run: {}", std::strerror(reason)))}));
}

}  // namespace

void AddStudyNames(CommandLine* line) {
  for (const StudyName& each : kStudyNames) AddCommand(&line->app, each.name, each.what, "");
}

std::string CommandWord(int argc, const char* const* argv) {
  // Options before the command that have a value of their own (AddGlobalOptions).
  constexpr std::array<std::string_view, 3> kWithValue = {"--socket", "--timeout", "--color"};
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (word.empty() || word.front() != '-') return std::string(word);
    if (std::ranges::find(kWithValue, word) != kWithValue.end()) ++i;
  }
  return {};
}

int RunProgram(int argc, char** argv) {
  if (const auto exit = RunStudyProgram(argc, argv)) return *exit;
  return Main(argc, argv, AddStudyNames);
}

}  // namespace focalfleet::cli
