// The completion scripts in the shells themselves: zsh and fish offer every command and option.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>

#include "daemon/cli/command_line.h"
#include "daemon/cli/completion.h"
#include "daemon/study/study.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using cli::CompletionNode;
using test::RunProgram;
using ::testing::Contains;
using ::testing::IsEmpty;

using Words = std::set<std::string>;
/// The words that a shell offers, by the line that is being typed.
using Offers = std::map<std::string, Words>;

struct Shell {
  const char* name;
  std::vector<std::string> command;  // the script's path and the lines' path follow
  char after_word;                   // ends the word in a line of the answer
};

// Both shells read lines, and print `## LINE` before what they offer after it.
const Shell kFish{"fish",
                  {"fish", "--no-config", "-c",
                   "source $argv[1]; while read -l line; echo \"## $line\"; complete -C $line; end "
                   "< $argv[2]"},
                  '\t'};
// The functions of zsh's completion system print what they would show.
const Shell kZsh{"zsh",
                 {"zsh", "-f", "-c",
                  "_describe() { local last=${@[-1]}; print -rl -- ${(P)last} }\n"
                  "compadd() { print -rl -- ${@[2,-1]} }\n"
                  "_files() { print -r -- @files }\n"
                  "source $1\n"
                  "while IFS= read -r line; do\n"
                  "  print -r -- \"## $line\"\n"
                  "  words=(${(z)line}); [[ $line == *' ' ]] && words+=('')\n"
                  "  CURRENT=${#words}; _focalfleet\n"
                  "done < $2",
                  "zsh"},
                 ':'};

Offers OffersOf(const Shell& shell, const std::vector<std::string>& lines) {
  const test::ScratchFolder scratch;
  const std::string script = test::Focalfleet({"completion", shell.name}).out;
  std::string all;
  for (const std::string& line : lines) all += line + "\n";
  std::vector<std::string> command = shell.command;
  command.push_back(scratch.Put("script", script));
  command.push_back(scratch.Put("lines", all));
  // A shell completes the arguments of a command that it finds.
  const std::string folder = std::filesystem::path(FOCALFLEET_PROGRAM).parent_path();
  const auto ran = RunProgram(
      command, {{"PATH", folder + ":" + std::getenv("PATH")}, {"HOME", scratch / "home"}});
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.err, IsEmpty());
  Offers offers;
  std::istringstream answer(ran.out);
  std::string text;
  std::string line;
  while (std::getline(answer, text)) {
    if (text.starts_with("## ")) {
      line = text.substr(3);
      offers[line];
    } else if (!text.empty()) {
      offers[line].insert(text.substr(0, text.find(shell.after_word)));
    }
  }
  EXPECT_EQ(offers.size(), lines.size());
  return offers;
}

std::string LineOf(const CompletionNode& node) {
  return "focalfleet " + (node.path.empty() ? "" : node.path + " ");
}

class CompletionShells : public ::testing::TestWithParam<const Shell*> {};

TEST_P(CompletionShells, OfferEverySubcommandAndOptionOfTheTree) {
  const auto nodes = cli::WalkCommands(cli::MakeCommandLine(cli::AddStudyCommands)->app);
  std::vector<std::string> lines;
  for (const CompletionNode& node : nodes) {
    lines.push_back(LineOf(node));
    lines.push_back(LineOf(node) + "-");
  }
  Offers offers = OffersOf(*GetParam(), lines);
  for (const CompletionNode& node : nodes) {
    for (const auto& child : node.commands) {
      EXPECT_THAT(offers[LineOf(node)], Contains(child.word)) << node.path;
    }
    Words options;
    for (const auto& option : node.options)
      options.insert(option.names.begin(), option.names.end());
    EXPECT_EQ(offers[LineOf(node) + "-"], options) << node.path;
  }
}

TEST_P(CompletionShells, OfferWordsAndPassOverTheValuesOfOptions) {
  const std::string axis = "focalfleet --socket status params 17 get --json ";
  const std::string shell = "focalfleet completion ";
  const std::string mode = "focalfleet tune --mode ";
  Offers offers = OffersOf(*GetParam(), {axis, shell, mode});
  EXPECT_EQ(offers[axis], (Words{"theta", "phi"}));
  EXPECT_EQ(offers[shell], (Words{"bash", "zsh", "fish"}));
  EXPECT_EQ(offers[mode], (Words{"asymmetric", "five-segment", "seven-segment"}));
}

INSTANTIATE_TEST_SUITE_P(Shells, CompletionShells, ::testing::Values(&kFish, &kZsh),
                         [](const auto& shell) { return std::string(shell.param->name); });

}  // namespace
}  // namespace focalfleet
