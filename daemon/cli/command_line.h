// CommandLine is the tree of commands, built once. Help, the parser, the tab completion and the
// tests all read this one tree, so nothing about the command line is written twice. A command's
// callback only stores what to run. The command runs after the whole line has been parsed and found
// valid.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "daemon/cli/context.h"
#include "daemon/usage/manual.h"

namespace focalfleet::cli {

using Run = std::function<ExitCode(const Context&)>;

struct CommandLine;
/// Adds the study commands: all of them with their options (study/study.h), or their names alone
/// (study_program.h).
using AddStudy = void (*)(CommandLine* line);

struct CommandLine {
  CLI::App app;
  Context context;
  Run run;
  AddStudy add_study = nullptr;
};

/// The complete tree.
std::unique_ptr<CommandLine> MakeCommandLine(AddStudy add_study);

/// The man pages of focalfleet and its commands.
std::vector<usage::ManualPage> Manual(AddStudy add_study);

/// Parses the command line and runs the command. Returns the exit code; the reason of a failure is
/// on stderr.
int Main(int argc, char** argv, AddStudy add_study);

// ---- Functions for the files that add commands

/// A command's options in a block of their own on the heap, which lives as long as the tree.
template <class Options>
void OnChosen(CommandLine* line, CLI::App* command, std::shared_ptr<Options> options,
              ExitCode (*run)(const Context&, const Options&)) {
  command->callback([line, options, run] {
    line->run = [options, run](const Context& context) { return run(context, *options); };
  });
}

/// Adds a command. Help shows the examples, each behind two blanks, under a title of their own.
CLI::App* AddCommand(CLI::App* parent, const char* name, const char* what, const char* examples);

/// Adds the name of a file that is read. The command itself checks that the file is readable: a
/// missing file is bad input (1), not usage (2).
CLI::Option* AddFile(CLI::App* command, const char* name, std::string* path, const char* what);

/// Restricts the value to one of the words; completion offers them.
CLI::Option* OneOf(CLI::Option* option, const std::vector<std::string>& words);

/// Accepts a finite number of the range, which help shows; CLI::Range lets a nan pass and prints
/// 309 digits.
CLI::Validator NumberBetween(double low, double high);

void AddImportCommands(CommandLine* line);  // import, export
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
void AddCampaignCommands(CommandLine* line);
void AddCanCommands(CommandLine* line);
void AddMeasurementsCommand(CommandLine* line);
void AddModelCommands(CommandLine* line);
void AddStoreCommands(CommandLine* line);
void AddAccessCommands(CommandLine* line);  // access, audit, token
void AddDoctorCommand(CommandLine* line);
void AddIncidentCommand(CommandLine* line);
void AddCompletionCommand(CommandLine* line);
void AddHelpCommand(CommandLine* line);

}  // namespace focalfleet::cli
