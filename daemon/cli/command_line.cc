#include "daemon/cli/command_line.h"

#include <fmt/format.h>

namespace focalfleet::cli {
namespace {

constexpr const char* kEveryCommand =
    "Every command takes --json, --quiet and --socket PATH; `focalfleet --help` lists the exit "
    "codes.";

void AddGlobalOptions(CommandLine* line) {
  CLI::App& app = line->app;
  app.set_version_flag("--version", "focalfleet " FOCALFLEET_VERSION);
  app.add_flag("--json", line->context.json, "One JSON object on stdout, nothing else there");
  app.add_flag("-q,--quiet", line->context.quiet, "No progress, no summary; errors are still told");
  app.add_option("--socket", line->context.socket,
                 fmt::format("Control socket of the daemon (default: $FOCALFLEET_SOCKET, else {})",
                             kDefaultSocket))
      ->type_name("FILE");
}

}  // namespace

CLI::App* AddCommand(CLI::App* parent, const char* name, const char* what, const char* examples) {
  CLI::App* command = parent->add_subcommand(name, what);
  command->footer(fmt::format("Examples:\n{}\n{}", examples, kEveryCommand));
  return command;
}

CLI::Option* AddFile(CLI::App* command, const char* name, std::string* path, const char* what) {
  return command->add_option(name, *path, what)->type_name("FILE");
}

CLI::Option* OneOf(CLI::Option* option, const std::vector<std::string>& words) {
  option->check(CLI::IsMember(words).description(""));
  option->type_name(fmt::format("{{{}}}", fmt::join(words, ",")));
  return option;
}

std::unique_ptr<CommandLine> MakeCommandLine() {
  auto line = std::make_unique<CommandLine>();
  CLI::App& app = line->app;
  app.name("focalfleet");
  app.description(
      "Operates a fleet of fibre positioners: prepares configurations from files, and talks to "
      "focalfleetd.");
  app.footer(kExitCodesHelp);
  app.fallthrough();  // a global option may stand after the command, too
  app.require_subcommand(1);
  AddGlobalOptions(line.get());
  AddLayoutCommand(line.get());
  AddTargetsCommand(line.get());
  AddPlanCommand(line.get());
  AddApplyCommand(line.get());
  AddStatusCommands(line.get());
  AddWatchCommand(line.get());
  AddStopCommand(line.get());
  AddUnitCommands(line.get());
  AddCompletionCommand(line.get());
  return line;
}

int Main(int argc, char** argv) {
  const std::unique_ptr<CommandLine> line = MakeCommandLine();
  try {
    line->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // CLI11 speaks in exceptions; help and version are exceptions, too, with exit code 0.
    if (error.get_exit_code() == 0) return line->app.exit(error);
    line->context.LookAtTerminals();
    return static_cast<int>(
        Report(line->context,
               Failure{ExitCode::kUsage,
                       {ErrorCode::kInvalid,
                        fmt::format("{} (`focalfleet --help` shows the usage)", error.what())}}));
  }
  line->context.LookAtTerminals();
  return static_cast<int>(line->run(line->context));
}

}  // namespace focalfleet::cli
