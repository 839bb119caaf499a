// The command line of focalfleet-sim: without a subcommand it runs the fleet; the subcommands ask a
// running one through its control socket.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace focalfleet::simulator {

/// The process' exit code: 0 done, 1 refused or failed (stderr says why), 2 wrong usage, 4 nobody
/// answers at the control socket.
int Main(int argc, char** argv);

/// "vcan0,vcan1" or "vcan0...vcan49": interface names in the order of the buses.
/// Errors: kInvalid, names the piece.
Result<std::vector<std::string>> ParseInterfaces(const std::string& text);

/// "1,2,5-9".
/// Errors: kInvalid, names the piece.
Result<std::vector<std::uint32_t>> ParseNumbers(const std::string& text);

}  // namespace focalfleet::simulator
