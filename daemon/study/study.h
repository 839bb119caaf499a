// The study commands simulate drives, tune them, reproduce published results and diagnose
// campaigns. None of them asks the daemon. They are a program of their own, focalfleet-study,
// because they need ten times the code of all other commands: who operates a fleet builds and
// starts without it. focalfleet runs that program where a study command is wanted
// (cli/study_program.h).
#pragma once

#include "daemon/cli/command_line.h"

namespace focalfleet::cli {

void AddSimulateCommand(CommandLine* line);
void AddSimulateCampaign(CLI::App* parent, CommandLine* line);
void AddDiagnoseCommand(CommandLine* line);
void AddTuneCommand(CommandLine* line);
void AddReproduceCommand(CommandLine* line);
void AddHallCommands(CommandLine* line);

/// All of them, with their options. For MakeCommandLine.
void AddStudyCommands(CommandLine* line);

}  // namespace focalfleet::cli
