// The program focalfleetd: buses of one machine, their store and their status.
#pragma once

namespace focalfleet {

/// Reads the command line and the configuration, and runs the daemon until it is asked to end.
/// Returns the exit code; where a part hangs at the end, the process exits within the call.
int RunFocalfleetd(int argc, char** argv);

}  // namespace focalfleet
