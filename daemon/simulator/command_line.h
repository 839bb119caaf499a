// The command line of focalfleet-sim runs the fleet where it has no subcommand. The subcommands
// send requests to a running simulation through its control socket.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::simulator {

/// The process' exit code: 0 done, 1 refused or failed (stderr gives the reason), 2 wrong usage, 4
/// no answer at the control socket.
int Main(int argc, char** argv);

/// Interface names in the order of the buses, from text such as "vcan0,vcan1" or "vcan0...vcan49".
/// Errors: kInvalid, names the piece.
Result<std::vector<std::string>> ParseInterfaces(const std::string& text);

}  // namespace focalfleet::simulator
