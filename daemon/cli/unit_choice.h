// The units that a command acts on, as an operator chooses them: `7,20-25`, all of a bus, all in
// one state. Every command that takes several units takes them in this way.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"

namespace focalfleet::cli {

struct UnitChoice {
  std::vector<std::string> units;  // each as 7,20-25
  std::string buses;
  std::vector<std::string> states;

  [[nodiscard]] bool empty() const { return units.empty() && buses.empty() && states.empty(); }
};

/// Adds UNIT..., --bus and --state to the command.
void AddUnitChoice(CLI::App* command, UnitChoice* choice);

/// Adds UNIT... alone, where --state means something else.
CLI::Option* AddUnitNumbers(CLI::App* command, UnitChoice* choice, const std::string& help);

/// The unit_ids. The daemon is asked only where a bus or a state is given. Errors: kUsage where
/// nothing is given; those of the daemon.
tl::expected<std::vector<std::uint32_t>, Failure> ChosenUnits(const Context& context,
                                                              const UnitChoice& choice);

}  // namespace focalfleet::cli
