// ExitCode holds the exit codes that an operator's shell receives: six numbers, the same for every
// command.
#pragma once

#include "protocol/base/result.h"

namespace focalfleet::cli {

enum class ExitCode : int {
  kOk = 0,
  kRefused = 1,       // refused or invalid input: nothing changed
  kUsage = 2,         // the command line itself is wrong
  kSomeUnserved = 3,  // done, but some units were not served; they are named
  kNoDaemon = 4,      // the daemon cannot be reached
  kBroken = 5,        // stopped or failed on the way
};

/// The reason why a command ends without having done its work.
struct Failure {
  ExitCode exit = ExitCode::kRefused;
  Error error;
  bool answered = false;  // the daemon said so, and can be asked something else
};

struct ExitCodeText {
  ExitCode code;
  const char* text;
};

inline constexpr ExitCodeText kExitCodeTexts[] = {
    {ExitCode::kOk, "done"},
    {ExitCode::kRefused, "refused or invalid input; nothing changed"},
    {ExitCode::kUsage, "wrong usage"},
    {ExitCode::kSomeUnserved, "done, but some units were not served (they are named)"},
    {ExitCode::kNoDaemon, "the daemon cannot be reached"},
    {ExitCode::kBroken, "stopped or failed on the way"},
};

}  // namespace focalfleet::cli
