#include "daemon/simulator/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>

#include "daemon/cli/command_line.h"
#include "daemon/cli/context.h"
#include "daemon/cli/exit_code.h"
#include "daemon/control/id_ranges.h"
#include "daemon/simulator/interface_names.h"
#include "daemon/simulator/simulator.h"
#include "daemon/simulator/subcommands.h"
#include "daemon/usage/build_version.h"
#include "daemon/usage/complaint.h"
#include "daemon/usage/help.h"

namespace focalfleet::simulator {
namespace {

using cli::ExitCode;

const usage::HelpClosing kClosing{
    .of_commands = "`focalfleet-sim --help` lists the exit codes.",
    .manual = "focalfleet-sim",
};

const std::vector<std::pair<std::string, std::string>>& ExitCodes() {
  static const std::vector<std::pair<std::string, std::string>> codes = {
      {"0", "done"},
      {"1", "refused or failed; stderr has the reason"},
      {"2", "wrong usage"},
      {"4", "nobody answers at the control socket"},
  };
  return codes;
}

Result<sim::PlantedTrait> ParsePlant(const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Fail(ErrorCode::kInvalid, "--plant " + text + ": " + why);
  };
  const std::size_t equals = text.find('='), colon = text.find(':');
  sim::PlantedTrait planted;
  const std::string cause = text.substr(0, std::min(equals, colon));
  const auto& names = sim::kPlantedCauseNames;
  const auto found = std::find(names.begin(), names.end(), cause);
  if (found == names.end()) return wrong("there is no cause '" + cause + "' to plant");
  planted.cause = static_cast<sim::PlantedCause>(found - names.begin());
  if (colon < equals) {
    const std::string axis = text.substr(colon + 1, equals - colon - 1);
    if (axis != "theta" && axis != "phi") return wrong("the axis is theta or phi");
    planted.on_axis = {axis == "theta", axis == "phi"};
  }
  constexpr double kSizeMax = 10;
  if (equals == std::string::npos || !Parse(text.substr(equals + 1), &planted.size) ||
      !(planted.size >= 0 && planted.size <= kSizeMax))
    return wrong("CAUSE=SIZE or CAUSE:AXIS=SIZE is expected, with a size of 0 to 10");
  return planted;
}

Result<SimulatorOptions::ClockError> ParseClockError(const std::string& text) {
  const auto wrong = [&](const std::string& why) {
    return Fail(ErrorCode::kInvalid, "--clock-error " + text + ": " + why);
  };
  constexpr double kShareMax = 0.1;
  const std::size_t equals = text.find('=');
  SimulatorOptions::ClockError error;
  if (equals == std::string::npos || !Parse(text.substr(equals + 1), &error.share) ||
      !(std::abs(error.share) <= kShareMax))
    return wrong("UNITS=SHARE is expected, with a share of -0.1 to 0.1");
  auto units = ParseRanges(text.substr(0, equals));
  if (!units) return wrong(units.error().text);
  error.units = std::move(*units);
  return error;
}

int Run(Given* given, const CLI::App& app) {
  if (given->run.units_path.empty()) {
    std::fprintf(stderr, "focalfleet-sim: --units is required (see %s --help)\n",
                 app.get_name().c_str());
    return static_cast<int>(ExitCode::kUsage);
  }
  if (given->run.unix_directory.empty() == given->buses_text.empty()) {
    std::fputs("focalfleet-sim: either --unix-directory or --bus is required\n", stderr);
    return static_cast<int>(ExitCode::kUsage);
  }
  if (!given->buses_text.empty()) {
    auto interfaces = ParseInterfaces(given->buses_text);
    if (!interfaces) return Complain(interfaces.error(), ExitCode::kUsage);
    given->run.interfaces = std::move(*interfaces);
  }
  if (given->run.camera_directory.empty() != given->run.fiducials_path.empty()) {
    std::fputs("focalfleet-sim: --camera and --fiducials go together\n", stderr);
    return static_cast<int>(ExitCode::kUsage);
  }
  given->run.control_path = given->control;
  given->run.spread = given->spread == "real" ? sim::Spread::kReal : sim::Spread::kNominal;
  for (const std::string& text : given->plant) {
    const auto planted = ParsePlant(text);
    if (!planted) return Complain(planted.error(), ExitCode::kUsage);
    given->run.planted.push_back(*planted);
  }
  if (!given->plant.empty() && !given->run.flash_path.empty()) {
    std::fputs("focalfleet-sim: --plant and --flash exclude each other: FLASH does not keep it\n",
               stderr);
    return static_cast<int>(ExitCode::kUsage);
  }
  for (const std::string& text : given->clock_errors) {
    auto error = ParseClockError(text);
    if (!error) return Complain(error.error(), ExitCode::kUsage);
    given->run.clock_errors.push_back(std::move(*error));
  }
  const auto ran = RunSimulator(given->run);
  return ran ? static_cast<int>(ExitCode::kOk) : Complain(ran.error(), ExitCode::kRefused);
}

void AddRunOptions(CLI::App* app, Given* given) {
  SimulatorOptions& run = given->run;
  app->add_option("--units", run.units_path, "units.csv: the fleet")->type_name("FILE");
  app->add_option("--state", run.state_path,
                  "state.csv: where the axes stand at first (otherwise folded)")
      ->type_name("FILE");
  app->add_option("--unix-directory", run.unix_directory,
                  "Folder for one UNIX socket a bus, bus<ID>.sock")
      ->type_name("DIR");
  app->add_option("--bus", given->buses_text,
                  "SocketCAN interfaces by ascending bus_id: vcan0,vcan1 or vcan0...vcan49")
      ->type_name("LIST");
  app->add_option("--control", given->control, "Control socket for the commands")
      ->type_name("FILE");
  app->add_option("--flash", run.flash_path,
                  "The units' FLASH: read at the start if it is there, written at the end")
      ->type_name("FILE");
  app->add_option(
         "--faults", run.faults_path,
         "faults.csv: which bus or unit misbehaves how, from when to when; chance by --seed")
      ->type_name("FILE");
  app->add_option("--camera", run.camera_directory,
                  "Folder where focalfleetd asks a camera for exposures, which are answered there")
      ->type_name("DIR");
  app->add_option("--fiducials", run.fiducials_path,
                  "fiducials.csv: the lights that the camera sees, too")
      ->type_name("FILE");
  app->add_option("--camera-noise-um", run.camera_noise_um,
                  "Noise of one coordinate of a usual spot")
      ->check(cli::NumberBetween(0, 1000))
      ->capture_default_str();
  app->add_option("--camera-air-um", run.camera_air_um,
                  "Turbulence of one coordinate, nearly the same for neighbours")
      ->check(cli::NumberBetween(0, 1000))
      ->capture_default_str();
  app->add_option("--speed", run.speed, "So many times faster than real time")
      ->check(cli::NumberBetween(0.01, 1000))
      ->capture_default_str();
  app->add_option("--seed", run.seed, "Seed of all chance")->capture_default_str();
  app->add_option("--spread", given->spread,
                  "nominal: units as described; real: the spread of service")
      ->check(CLI::IsMember({"nominal", "real"}).description(""))
      ->type_name("{nominal,real}")
      ->capture_default_str();
  app->add_option("--plant", given->plant,
                  "A cause on top of the spread: zero_offset (deg), arm_length (mm), gear_scale "
                  "(share), backlash (deg) or eccentricity (deg)")
      ->type_name("CAUSE[:AXIS]=SIZE");
  app->add_option(
         "--clock-error", given->clock_errors,
         "The clocks of these units run that much fast, or slow below 0 (otherwise up to 50 "
         "ppm)")
      ->type_name("UNITS=SHARE");
  app->add_option("--bit-rate", run.bit_rate_bps, "Bit rate of the simulated buses, bit/s")
      ->check(CLI::Range(10'000, 1'000'000))
      ->capture_default_str();
}

/// The tree of commands, with what each runs.
struct CommandTree {
  Given given;
  CLI::App app{"Simulates a fleet", "focalfleet-sim"};
  std::vector<Subcommand> subcommands;
};

std::unique_ptr<CommandTree> MakeCommandTree() {
  auto tree = std::make_unique<CommandTree>();
  CLI::App& app = tree->app;
  app.description(
      "Simulates a fleet that answers on UNIX sockets or SocketCAN interfaces as units do, until "
      "SIGTERM. It prints `ready` when all of them are open.");
  app.formatter(std::make_shared<usage::HelpFormatter>(kClosing));
  app.set_help_flag("-h,--help", "Show this help");
  app.set_version_flag("--version", BuildVersion(), "Show the version");
  app.require_subcommand(0, 1);
  AddRunOptions(&app, &tree->given);
  tree->subcommands = AddSubcommands(&app, &tree->given);
  std::string footer = "Exit codes:";
  for (const auto& [code, text] : ExitCodes()) footer += fmt::format("\n  {}  {}", code, text);
  app.footer(footer);
  return tree;
}

}  // namespace

std::vector<usage::ManualPage> Manual() {
  return usage::ManualOf(
      MakeCommandTree()->app,
      {.closing = kClosing,
       .section = 1,
       .version = FOCALFLEET_VERSION,
       .description =
           {"focalfleet-sim simulates the units of units.csv with their firmware, motors and "
            "buses. "
            "focalfleetd(8) finds them behind UNIX sockets (port = \"unix\") or on CAN interfaces.",
            "Without a command the simulation runs. The commands ask a simulation that runs, "
            "through its control socket: they show where units truly are, and plant faults."},
       .exit_codes = ExitCodes(),
       .see_also = "focalfleet(1), focalfleetd(8), focalfleet-protocol(7)"});
}

int Main(int argc, char** argv) {
  const std::unique_ptr<CommandTree> tree = MakeCommandTree();
  // CLI11 is the only library here that throws; its exceptions end here.
  try {
    tree->app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return tree->app.exit(error);
    return Complain({ErrorCode::kInvalid, usage::Complaint(tree->app, error) +
                                              " (`focalfleet-sim --help` shows the usage)"},
                    ExitCode::kUsage);
  }
  for (const Subcommand& subcommand : tree->subcommands) {
    if (!subcommand.app->parsed()) continue;
    const int exit = subcommand.run();
    if (exit != 0 || cli::OutputError() == 0) return exit;
    return Complain({ErrorCode::kUnavailable, std::string("standard output cannot be written: ") +
                                                  std::strerror(cli::OutputError())},
                    ExitCode::kRefused);
  }
  return Run(&tree->given, tree->app);
}

}  // namespace focalfleet::simulator
