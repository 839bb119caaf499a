// The command line of focalfleet-sim runs the fleet where it has no subcommand. The subcommands
// send requests to a running simulation through its control socket.
#pragma once

#include <vector>

#include "daemon/usage/manual.h"

namespace focalfleet::simulator {

/// The process' exit code: 0 done, 1 refused or failed (stderr gives the reason), 2 wrong usage, 4
/// no answer at the control socket.
int Main(int argc, char** argv);

/// The man page of focalfleet-sim.
std::vector<usage::ManualPage> Manual();

}  // namespace focalfleet::simulator
