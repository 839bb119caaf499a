// Rules of every command: exit codes of wrong usage, help, JSON, and completion for the whole tree.
#include "daemon/cli/command_line.h"

#include <gmock/gmock.h>

#include "daemon/cli/completion.h"
#include "daemon/study/study.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet {
namespace {

using cli::CompletionNode;
using cli::CompletionValue;
using test::Focalfleet;
using test::RunProgram;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::IsSupersetOf;

std::vector<CompletionNode> Nodes() {
  return cli::WalkCommands(cli::MakeCommandLine(cli::AddStudyCommands)->app);
}

std::vector<std::string> Words(const std::string& path) {
  return path.empty() ? std::vector<std::string>{} : CLI::detail::split(path, ' ');
}

// Returns what bash would offer after these words, the last of which is being typed.
std::vector<std::string> BashOffers(std::vector<std::string> words) {
  std::vector<std::string> command = {
      "bash",
      "--norc",
      "-c",
      "source <(\"$1\" completion bash); shift; COMP_WORDS=(focalfleet \"$@\"); "
      "COMP_CWORD=$#; _focalfleet; printf '%s\\n' \"${COMPREPLY[@]}\"",
      "bash",
      FOCALFLEET_PROGRAM};
  command.insert(command.end(), words.begin(), words.end());
  const auto result = RunProgram(command);
  EXPECT_EQ(result.exit, 0) << result.err;
  EXPECT_THAT(result.err, IsEmpty());
  return CLI::detail::split(result.out, '\n');
}

TEST(CommandLine, HelpOfEveryCommandShowsExamplesAndEndsWell) {
  for (const CompletionNode& node : Nodes()) {
    auto words = Words(node.path);
    words.emplace_back("--help");
    const auto result = Focalfleet(words);
    EXPECT_EQ(result.exit, 0) << node.path;
    EXPECT_THAT(result.out, HasSubstr(node.commands.empty() ? "Examples:" : "Usage:")) << node.path;
    EXPECT_THAT(result.err, IsEmpty()) << node.path;
  }
}

TEST(CommandLine, HelpListsTheExitCodes) {
  EXPECT_THAT(Focalfleet({"--help"}).out, HasSubstr("4  the daemon cannot be reached"));
}

TEST(CommandLine, VersionNamesTheProgram) {
  const auto result = Focalfleet({"--version"});
  EXPECT_EQ(result.exit, 0);
  EXPECT_THAT(result.out, ::testing::StartsWith("focalfleet "));
}

TEST(CommandLine, EveryCommandRefusesAnUnknownOptionAsWrongUsage) {
  for (const CompletionNode& node : Nodes()) {
    auto words = Words(node.path);
    words.emplace_back("--no-such-option");
    const auto result = Focalfleet(words);
    EXPECT_EQ(result.exit, 2) << node.path;
    EXPECT_THAT(result.out, IsEmpty()) << node.path;
    EXPECT_THAT(result.err, HasSubstr("error:")) << node.path;
  }
}

TEST(CommandLine, NoCommandAndAnUnknownCommandAreWrongUsage) {
  EXPECT_EQ(Focalfleet({}).exit, 2);
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"teleport"}, {"--socket", "s", "teleport", "--far"}}) {
    const auto unknown = Focalfleet(words);
    EXPECT_EQ(unknown.exit, 2);
    EXPECT_THAT(unknown.err, HasSubstr("there is no command 'teleport' (`focalfleet --help`"));
    EXPECT_THAT(unknown.out, IsEmpty());
  }
  const auto none = Focalfleet({});
  EXPECT_THAT(none.out, IsEmpty()) << "a script that lost its command gets no answer";
  EXPECT_THAT(none.err, HasSubstr("Watch the fleet:\n  status "));
  const auto below = Focalfleet({"layout", "cubic"});
  EXPECT_EQ(below.exit, 2);
  EXPECT_THAT(below.err, HasSubstr("there is no command 'layout cubic'"));
}

TEST(CommandLine, SuggestsTheNearestCommandAndOption) {
  const auto command = Focalfleet({"stauts"});
  EXPECT_EQ(command.exit, 2);
  EXPECT_THAT(command.err, HasSubstr("there is no command 'stauts'; did you mean 'status'?"));
  const auto option = Focalfleet({"plan", "--unit", "u.csv", "--targets", "t.csv"});
  EXPECT_EQ(option.exit, 2);
  EXPECT_THAT(option.err, HasSubstr("there is no option '--unit'; did you mean '--units'?"));
}

TEST(CommandLine, HelpShowsTheHelpOfACommand) {
  for (const CompletionNode& node : Nodes()) {
    auto words = Words(node.path);
    words.insert(words.begin(), "help");
    const auto shown = Focalfleet(words);
    words.erase(words.begin());
    words.emplace_back("--help");
    EXPECT_EQ(shown.exit, 0) << node.path;
    EXPECT_EQ(shown.out, Focalfleet(words).out) << node.path;
  }
  const auto unknown = Focalfleet({"help", "layout", "hxe"});
  EXPECT_EQ(unknown.exit, 2);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean 'layout hex'?"));
  const Json tree = Json::parse(Focalfleet({"help", "--json"}).out);
  EXPECT_EQ(tree["commands"].size(), Nodes().size());
}

TEST(CommandLine, EveryCommandIsInAGroupOfItsOwnAndHelpIsWithoutTheParsersWords) {
  const auto line = cli::MakeCommandLine(cli::AddStudyCommands);
  std::vector<std::string> tools;
  for (const CLI::App* command : line->app.get_subcommands({})) {
    if (command->get_group() == "Tools") tools.push_back(command->get_name());
  }
  EXPECT_THAT(tools,
              ::testing::UnorderedElementsAre("can", "completion", "help", "incident", "store"))
      << "a new command joins a group of Groups() in command_line.cc, or this list";
  for (const CompletionNode& node : Nodes()) {
    auto words = Words(node.path);
    words.emplace_back("--help");
    const std::string help = Focalfleet(words).out;
    for (const char* word : {"UINT", "INT:", "FLOAT", "REQUIRED", " in [", "SUBCOMMAND"})
      EXPECT_THAT(help, ::testing::Not(HasSubstr(word))) << node.path;
    EXPECT_THAT(help, HasSubstr("\nManual: man focalfleet")) << node.path;
  }
}

TEST(CommandLine, TheTimeoutIsThatOfTheDaemonsSilence) {
  const auto result = Focalfleet({"status", "--timeout", "0"});
  EXPECT_EQ(result.exit, 2);
  EXPECT_THAT(result.err, HasSubstr("0 is not a number of 0.01 to 86400"));
}

TEST(CommandLine, ColoursAreAsAskedFor) {
  const auto err = [](const std::string& when) {
    return Focalfleet({"status", "--socket", "/nowhere/s", "--color", when}).err;
  };
  EXPECT_THAT(err("always"), HasSubstr("\033[31merror:"));
  EXPECT_THAT(err("never"), ::testing::Not(HasSubstr("\033")));
  EXPECT_THAT(err("auto"), ::testing::Not(HasSubstr("\033"))) << "a pipe";
  EXPECT_EQ(Focalfleet({"status", "--color", "pink"}).exit, 2);
}

TEST(CommandLine, AnAnswerThatStdoutDoesNotTakeIsNotDone) {
  const test::ScratchFolder scratch;
  const std::string units = scratch / "u.csv";
  for (const std::string into : {">/dev/full", ">&-"}) {
    for (const std::vector<std::string>& words :
         {std::vector<std::string>{"--help"},
          {"--version"},
          {"completion", "bash"},
          {"layout", "hex", "--count", "3", "--out", units},
          {"layout", "hex", "--count", "3", "--out", units, "--json"}}) {
      const auto result = test::FocalfleetInto(into, words);
      EXPECT_EQ(result.exit, 1) << words[0] << into;
      EXPECT_THAT(result.err, HasSubstr("standard output cannot be written")) << words[0] << into;
    }
    EXPECT_THAT(test::Slurp(units), ::testing::StartsWith("unit_id,")) << into;
    EXPECT_THAT(test::Slurp(units), ::testing::Not(HasSubstr("pitch"))) << into;
  }
  EXPECT_EQ(test::FocalfleetInto(">/dev/full", {"status", "--socket", "/nowhere/s"}).exit, 4)
      << "the first reason stays";
  EXPECT_EQ(test::FocalfleetInto("2>/dev/full", {"status", "--socket", "/nowhere/s"}).exit, 4);
}

TEST(CommandLine, WrongUsageIsJsonWhereJsonWasAskedFor) {
  const auto result = Focalfleet({"--json", "unit", "not-a-number"});
  EXPECT_EQ(result.exit, 2);
  const Json reported = Json::parse(result.out, nullptr, false);
  ASSERT_TRUE(reported.is_object()) << result.out;
  EXPECT_EQ(reported["exit"], 2);
  EXPECT_EQ(reported["error"]["code"], "invalid");
}

TEST(CommandLine, GlobalOptionsStandBeforeOrAfterTheCommand) {
  const auto before = Focalfleet({"--socket", "/nowhere/s", "--json", "status"});
  const auto after = Focalfleet({"status", "--json", "--socket", "/nowhere/s"});
  EXPECT_EQ(before.exit, 4);
  EXPECT_EQ(after.exit, 4);
  EXPECT_EQ(before.out, after.out);
  EXPECT_THAT(before.out, HasSubstr("/nowhere/s"));
}

TEST(CommandLine, TheSocketComesFromTheEnvironmentWhereNoneIsGiven) {
  const auto result =
      RunProgram({FOCALFLEET_PROGRAM, "status"}, {{"FOCALFLEET_SOCKET", "/elsewhere/sock"}});
  EXPECT_EQ(result.exit, 4);
  EXPECT_THAT(result.err, HasSubstr("/elsewhere/sock"));
}

TEST(CommandLine, PrintsNoColourIntoAPipe) {
  EXPECT_THAT(Focalfleet({"status", "--socket", "/nowhere/s"}).err,
              ::testing::Not(HasSubstr("\033")));
}

TEST(Completion, BashOffersEverySubcommandAndOptionOfTheTree) {
  for (const CompletionNode& node : Nodes()) {
    std::vector<std::string> commands;
    for (const auto& child : node.commands) commands.push_back(child.word);
    std::vector<std::string> options;
    for (const auto& option : node.options) {
      for (const std::string& name : option.names) {
        if (name.rfind("--", 0) == 0) options.push_back(name);
      }
    }
    auto words = Words(node.path);
    words.emplace_back("");
    if (!commands.empty()) {
      EXPECT_THAT(BashOffers(words), IsSupersetOf(commands)) << node.path;
    }
    words.back() = "--";
    EXPECT_THAT(BashOffers(words), ::testing::UnorderedElementsAreArray(options)) << node.path;
  }
}

TEST(Completion, BashOffersFilesAndWordsWhereTheTreeTakesThem) {
  const test::ScratchFolder scratch;
  const std::string file = scratch.Put("targets with blank.csv", "");
  for (const CompletionNode& node : Nodes()) {
    for (const auto& option : node.options) {
      auto words = Words(node.path);
      words.push_back(option.names.front());
      if (option.value.kind == CompletionValue::Kind::kWords) {
        words.emplace_back("");
        EXPECT_EQ(BashOffers(words), option.value.words) << node.path << " " << words[0];
      }
      if (option.value.kind == CompletionValue::Kind::kFile) {
        words.push_back(scratch / "targ");
        EXPECT_THAT(BashOffers(words), ::testing::ElementsAre(file)) << node.path;
      }
    }
  }
  EXPECT_THAT(BashOffers({"apply", scratch / "t"}), ::testing::ElementsAre(file));
}

TEST(Completion, BashPassesOverOptionValuesAndCountsArguments) {
  EXPECT_EQ(BashOffers({"--socket", "status", "params", "17", "get", "--json", ""}),
            (std::vector<std::string>{"theta", "phi"}));
}

TEST(Completion, ZshScriptNamesEverySubcommandAndOptionOfTheTree) {
  const auto result = Focalfleet({"completion", "zsh"});
  ASSERT_EQ(result.exit, 0);
  EXPECT_THAT(result.out, ::testing::StartsWith("#compdef focalfleet\n"));
  for (const CompletionNode& node : Nodes()) {
    EXPECT_THAT(result.out, HasSubstr("'/" + node.path + "'"));
    for (const auto& child : node.commands) EXPECT_THAT(result.out, HasSubstr(child.word + ":"));
    for (const auto& option : node.options) {
      for (const std::string& name : option.names) EXPECT_THAT(result.out, HasSubstr(name + ":"));
    }
  }
}

TEST(Documentation, NamesEveryCommandAndOptionOfTheTree) {
  const std::string text = test::Slurp(FOCALFLEET_SOURCE_DIR "/docs/cli.md");
  for (const CompletionNode& node : Nodes()) {
    if (!node.path.empty()) {
      EXPECT_THAT(text, HasSubstr("`" + node.path)) << node.path;
    }
    for (const auto& option : node.options) {
      EXPECT_THAT(text, HasSubstr(option.names.front())) << node.path;
    }
  }
}

}  // namespace
}  // namespace focalfleet
