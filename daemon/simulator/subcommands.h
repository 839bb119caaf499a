// The subcommands of focalfleet-sim ask a simulation that runs, through its control socket: they
// show where units truly are, and plant faults.
#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "daemon/cli/exit_code.h"
#include "daemon/simulator/simulator.h"
#include "daemon/soak/soak_command.h"

namespace focalfleet::simulator {

/// The options of `misbehave`: the ways in which units answer wrongly.
struct Misbehaviour {
  std::optional<double> late_s;
  std::optional<std::uint32_t> copies;
  std::optional<std::uint32_t> foreign_serial;
  bool deaf = false;
  bool wrong_digest = false;
  bool mute_done = false;
};

/// The options of all subcommands, as CLI11 fills them in.
struct Given {
  SimulatorOptions run;
  std::string spread = "nominal";
  std::vector<std::string> plant;
  std::vector<std::string> clock_errors;
  std::string buses_text;
  std::string control;
  std::string units_text;
  std::string bus_numbers_text;
  std::string out;
  std::string targets;
  std::string code;
  std::string axis = "theta";
  std::uint32_t exposures = 1;
  double seconds = -1;
  double after_s = -1;
  Misbehaviour misbehaviour;
  soak::SoakOptions soak;
  bool off = false;
  bool json = false;
};

struct Subcommand {
  CLI::App* app;
  std::function<int()> run;  // returns the exit code
};

/// The subcommands stand in the tree and fill in `given`, which outlives them.
std::vector<Subcommand> AddSubcommands(CLI::App* app, Given* given);

/// Reports the reason on stderr; returns the exit code.
int Complain(const Error& error, cli::ExitCode code);

}  // namespace focalfleet::simulator
