// The fixture for commands that speak to the daemon runs the command as a process of its own
// against scripted answers. The fixture keeps the requests that the command sent.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "tests/daemon/cli/fake_daemon.h"
#include "tests/daemon/cli/program.h"
#include "tests/support/scratch_folder.h"

namespace focalfleet::test {

/// Two targets in mm, within the reach of units 1 and 2.
inline constexpr const char* kTargets = "unit_id,x_mm,y_mm\n1,0.5,0.25\n2,26.0,0.5\n";

/// The daemon's report of configuration 7 with two targets. Where `failed` is not 0, unit 2 is
/// listed as unserved.
Json ConfigurationAnswer(const std::string& state, std::uint64_t arrived, std::uint64_t failed);

/// The daemon's answer to `status`: two units at rest, one bus of two off.
Json StatusAnswer();

class DaemonCommands : public ::testing::Test {
 protected:
  /// Runs `words` against a daemon with these answers; requests_ holds what the daemon was asked.
  ProgramResult Ask(std::vector<std::string> words, std::map<std::string, FakeAnswer> answers);
  /// The same at a terminal, where `line` is typed.
  ProgramResult AskAtTerminal(const std::string& line, std::vector<std::string> words,
                              std::map<std::string, FakeAnswer> answers);
  /// Runs `apply` with kTargets and the options `more`.
  ProgramResult Apply(const std::vector<std::string>& more, FakeAnswer answer);

  ScratchFolder scratch_;
  std::vector<ControlRequest> requests_;
};

}  // namespace focalfleet::test
