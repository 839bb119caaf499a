// The study commands are in a program of their own, focalfleet-study (study/study.h). focalfleet
// knows their names, and runs that program in its place where one of them is wanted.
#pragma once

#include <string>

namespace focalfleet::cli {

struct CommandLine;

/// Adds the names of the study commands, for help. For MakeCommandLine.
void AddStudyNames(CommandLine* line);

/// The word on the command line that names a command; empty where there is none.
std::string CommandWord(int argc, const char* const* argv);

/// The program focalfleet: runs focalfleet-study in place of this process where the command is its
/// own, and otherwise the command (Main). focalfleet-study also has the complete help and
/// completion; where it is not installed, these are shown without the options of study commands.
/// The program is looked for beside this program, then in ../libexec/focalfleet. Returns the exit
/// code.
int RunProgram(int argc, char** argv);

}  // namespace focalfleet::cli
