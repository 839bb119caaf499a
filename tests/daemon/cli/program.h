// Runs a program to its end and keeps its output, as an operator's shell would.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace focalfleet::test {

struct ProgramResult {
  int exit = -1;  // negative: the signal that ended the program
  std::string out;
  std::string err;
};

/// Runs the program with an empty stdin. `environment` is added to this process's own; NO_COLOR and
/// the variable of the control socket are not passed on.
ProgramResult RunProgram(const std::vector<std::string>& arguments,
                         const std::vector<std::pair<std::string, std::string>>& environment = {});

/// Runs the focalfleet executable of this build.
ProgramResult Focalfleet(std::vector<std::string> arguments);

/// Runs focalfleet with stdout redirected as a shell would: `>/dev/full`, `>&-`. `redirection` may
/// redirect other streams, too.
ProgramResult FocalfleetInto(const std::string& redirection, std::vector<std::string> arguments);

/// Runs focalfleet at a terminal of its own, where somebody types `line`. `out` is all that the
/// terminal showed. Pre: the arguments need no quotes in a shell.
ProgramResult FocalfleetAtTerminal(const std::string& line,
                                   const std::vector<std::string>& arguments);

std::string Slurp(const std::string& path);

}  // namespace focalfleet::test
