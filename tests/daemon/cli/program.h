// Runs a program to its end and keeps what it said, as an operator's shell would.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace focalfleet::test {

struct ProgramResult {
  int exit = -1;  // negative: the signal that ended it
  std::string out;
  std::string err;
};

/// stdin is empty. `environment` is added to this process' own; NO_COLOR and the socket's variable
/// are not passed on.
ProgramResult RunProgram(const std::vector<std::string>& arguments,
                         const std::vector<std::pair<std::string, std::string>>& environment = {});

/// Runs the focalfleet executable of this build.
ProgramResult Focalfleet(std::vector<std::string> arguments);

/// The same, with stdout (and with more in `redirection` other streams) where a shell would put
/// them: `>/dev/full`, `>&-`.
ProgramResult FocalfleetInto(const std::string& redirection, std::vector<std::string> arguments);

std::string Slurp(const std::string& path);

}  // namespace focalfleet::test
