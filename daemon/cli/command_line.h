// The tree of commands, built once. Help, the parser, the tab completion and the tests all read
// this one tree, so that nothing about the command line is written down twice. A command's callback
// only remembers what to run; it runs after the whole line has been parsed and found right.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>

#include "daemon/cli/context.h"

namespace focalfleet::cli {

using Run = std::function<ExitCode(const Context&)>;

struct CommandLine {
  CLI::App app;
  Context context;
  Run run;
};

/// The complete tree.
std::unique_ptr<CommandLine> MakeCommandLine();

/// Parses and runs. Errors: the exit code; the reason is on stderr.
int Main(int argc, char** argv);

// ---- for the files that add commands

/// Options of a command in a block of their own on the heap, for as long as the tree lives.
template <class Options>
void OnChosen(CommandLine* line, CLI::App* command, std::shared_ptr<Options> options,
              ExitCode (*run)(const Context&, const Options&)) {
  command->callback([line, options, run] {
    line->run = [options, run](const Context& context) { return run(context, *options); };
  });
}

CLI::App* AddCommand(CLI::App* parent, const char* name, const char* what, const char* examples);

/// A file that is read. Its readability is checked by the command: a missing file is bad input (1),
/// not usage (2).
CLI::Option* AddFile(CLI::App* command, const char* name, std::string* path, const char* what);

/// Words of which the value must be one; completion offers them.
CLI::Option* OneOf(CLI::Option* option, const std::vector<std::string>& words);

/// A finite number of the range; CLI::Range lets a nan pass and prints 309 digits.
CLI::Validator NumberBetween(double low, double high);

void AddLayoutCommand(CommandLine* line);
void AddTargetsCommand(CommandLine* line);
void AddPlanCommand(CommandLine* line);
void AddEstimateCommand(CommandLine* line);
void AddApplyCommand(CommandLine* line);
void AddRetargetCommand(CommandLine* line);
void AddStatusCommands(CommandLine* line);  // status, unit, state, history
void AddWatchCommand(CommandLine* line);
void AddStopCommand(CommandLine* line);
void AddUnitCommands(CommandLine* line);  // home, disable, enable, adopt, params
void AddSimulateCommand(CommandLine* line);
void AddSimulateCampaign(CLI::App* parent, CommandLine* line);
void AddDiagnoseCommand(CommandLine* line);
void AddTuneCommand(CommandLine* line);
void AddReproduceCommand(CommandLine* line);
void AddCampaignCommands(CommandLine* line);
void AddCanCommands(CommandLine* line);
void AddHallCommands(CommandLine* line);
void AddMeasurementsCommand(CommandLine* line);
void AddModelCommands(CommandLine* line);
void AddCompletionCommand(CommandLine* line);

}  // namespace focalfleet::cli
