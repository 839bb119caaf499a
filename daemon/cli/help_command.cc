// `focalfleet help` shows the help of a command. With --json it prints the whole tree, for programs
// that check themselves against it.
#include <fmt/format.h>

#include "daemon/cli/command_line.h"
#include "daemon/cli/completion.h"
#include "daemon/usage/complaint.h"
#include "daemon/usage/option_text.h"

namespace focalfleet::cli {
namespace {

struct HelpOptions {
  AddStudy add_study = nullptr;
  std::vector<std::string> command;
};

Json OptionsJson(const CLI::App& app) {
  Json list = Json::array();
  for (const auto& options : {usage::ArgumentsOf(app), usage::OptionsOf(app)}) {
    for (const CLI::Option* option : options) {
      const usage::OptionText text = usage::TextOf(*option);
      list.push_back({{"names", text.names},
                      {"value", text.value},
                      {"what", text.description},
                      {"remarks", text.remarks}});
    }
  }
  return list;
}

/// Appends the command and all below it.
void Append(const CLI::App& app, Json* commands) {
  const auto below = app.get_subcommands({});
  commands->push_back({{"command", usage::PathOf(app)},
                       {"what", app.get_description()},
                       {"group", app.get_group()},
                       {"runs", usage::RunsByItself(app)},
                       {"options", OptionsJson(app)}});
  for (const CLI::App* command : below) Append(*command, commands);
}

ExitCode RunHelp(const Context& context, const HelpOptions& options) {
  const std::unique_ptr<CommandLine> line = MakeCommandLine(options.add_study);
  const CLI::App* app = &line->app;
  for (const std::string& word : options.command) {
    const CLI::App* next = nullptr;
    for (const CLI::App* command : app->get_subcommands({})) {
      if (command->get_name() == word) next = command;
    }
    if (next == nullptr)
      return Report(context, {ErrorCode::kInvalid, usage::NoSuchCommand(*app, word)},
                    ExitCode::kUsage);
    app = next;
  }
  if (context.json) {
    Json commands = Json::array();
    Append(*app, &commands);
    PrintJson({{"commands", commands}});
  } else {
    PrintText(app->help());
  }
  return ExitCode::kOk;
}

}  // namespace

void AddHelpCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "help", "Show the help of a command",
                 "  focalfleet help apply\n  focalfleet help layout hex\n  focalfleet help --json");
  auto options = std::make_shared<HelpOptions>();
  options->add_study = line->add_study;
  std::vector<std::string> names;
  for (const CLI::App* other : line->app.get_subcommands({})) names.push_back(other->get_name());
  // The names are for completion; a wrong one is answered with the nearest.
  command->add_option("COMMAND", options->command, "The command (otherwise the whole program)")
      ->type_name(fmt::format("{{{}}}", fmt::join(names, ",")))
      ->option_text(" ");
  OnChosen(line, command, options, RunHelp);
}

}  // namespace focalfleet::cli
