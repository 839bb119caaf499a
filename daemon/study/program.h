// The program focalfleet-study.
#pragma once

namespace focalfleet::cli {

/// All commands of focalfleet, those of study included. Returns the exit code.
int RunStudy(int argc, char** argv);

}  // namespace focalfleet::cli
