#include "daemon/simulator/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <functional>
#include <optional>

#include "daemon/cli/command_line.h"
#include "daemon/cli/context.h"
#include "daemon/cli/exit_code.h"
#include "daemon/control/id_ranges.h"
#include "daemon/control/line_client.h"
#include "daemon/control/printable.h"
#include "daemon/files/text_file.h"
#include "daemon/simulator/simulator.h"
#include "sim/hall/fibre_carrier.h"

namespace focalfleet::simulator {
namespace {

using cli::ExitCode;

constexpr std::size_t kNumbersMax = 100'000;

constexpr const char* kExitCodes =
    "Exit codes:\n"
    "  0  done\n"
    "  1  refused or failed; stderr says why\n"
    "  2  wrong usage\n"
    "  4  nobody answers at the control socket";

int Complain(const Error& error, ExitCode code) {
  std::fprintf(stderr, "focalfleet-sim: %s\n", PrintableLines(error.text).c_str());
  return static_cast<int>(code);
}

template <class Number>
bool Parse(std::string_view text, Number* number) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), *number);
  return error == std::errc() && end == text.data() + text.size();
}

std::vector<std::string> Split(const std::string& text, char separator) {
  std::vector<std::string> pieces;
  std::size_t begin = 0;
  for (std::size_t end = 0; end != std::string::npos; begin = end + 1) {
    end = text.find(separator, begin);
    pieces.push_back(text.substr(begin, end == std::string::npos ? end : end - begin));
  }
  return pieces;
}

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
  bool off = false;
  bool json = false;
};

/// Sends a request to the running simulation; `on_result` reports its result.
int Ask(const Given& given, const ControlRequest& request,
        const std::function<int(const Json&)>& on_result) {
  auto client = LineClient::Connect(given.control);
  if (!client) return Complain(client.error(), ExitCode::kNoDaemon);
  const auto result = client->Call(request.verb, request.args);
  if (!result)
    return Complain(result.error(), client->connected() ? ExitCode::kRefused : ExitCode::kNoDaemon);
  return on_result(*result);
}

int AskSimply(const Given& given, const ControlRequest& request) {
  return Ask(given, request, [&](const Json& result) {
    if (given.json) cli::PrintJson(result);
    return static_cast<int>(ExitCode::kOk);
  });
}

int AskAboutUnits(const Given& given, const char* verb, Json args) {
  const auto units = ParseRanges(given.units_text);
  if (!units) return Complain(units.error(), ExitCode::kUsage);
  args["units"] = *units;
  return AskSimply(given, {0, verb, std::move(args)});
}

int Misbehave(const Given& given) {
  Json args = Json::object();
  if (given.off) args["off"] = true;
  if (given.misbehaviour.late_s) args["late_s"] = *given.misbehaviour.late_s;
  if (given.misbehaviour.copies) args["copies"] = *given.misbehaviour.copies;
  if (given.misbehaviour.deaf) args["deaf"] = true;
  if (given.misbehaviour.wrong_digest) args["wrong_digest"] = true;
  if (given.misbehaviour.mute_done) args["mute_done"] = true;
  if (given.misbehaviour.foreign_serial)
    args["foreign_serial"] = *given.misbehaviour.foreign_serial;
  if (args.empty())
    return Complain({ErrorCode::kInvalid, "misbehave: say how (--help lists the ways)"},
                    ExitCode::kUsage);
  return AskAboutUnits(given, "misbehave", std::move(args));
}

int SetBuses(const Given& given, const char* verb) {
  const auto buses = ParseRanges(given.bus_numbers_text);
  if (!buses) return Complain(buses.error(), ExitCode::kUsage);
  return AskSimply(given, {0, verb, {{"buses", *buses}}});
}

int WriteField(const Given& given) {
  std::string text = "theta_deg,phi_deg,b_T\n";
  constexpr int kStepDeg = 4;
  const sim::FibreCarrierJoints joints({});
  for (int theta = 0; theta <= 180; theta += kStepDeg)
    for (int phi = 0; phi < 360; phi += kStepDeg)
      text += fmt::format("{},{},{}\n", theta, phi,
                          joints.Field_T(theta * sim::kRadPerDeg, phi * sim::kRadPerDeg));
  const auto written = WriteFileAtomically(given.out, text);
  return written ? static_cast<int>(ExitCode::kOk) : Complain(written.error(), ExitCode::kRefused);
}

int ReportTruth(const Given& given) {
  Json args = Json::object();
  if (!given.targets.empty()) {
    const auto text = ReadTextFile(given.targets);
    if (!text) return Complain(text.error(), ExitCode::kRefused);
    args = {{"targets_csv", *text}, {"targets_name", given.targets}};
  }
  return Ask(given, {0, "truth", args}, [&](const Json& result) {
    if (!given.out.empty()) {
      const auto written = WriteFileAtomically(given.out, result.value("csv", ""));
      if (!written) return Complain(written.error(), ExitCode::kRefused);
    }
    if (given.json) {
      Json summary = result;
      summary.erase("csv");
      cli::PrintJson(summary);
    } else if (result.contains("targets")) {
      const Json& errors = result["targets"];
      cli::PrintText(fmt::format(
          "{} units compared, worst is unit {} with {:.1f} um\ntrue position {:.1f} um rms\n",
          errors.value("units", 0ull), errors.value("worst_unit_id", 0u),
          errors.value("max_um", 0.0), errors.value("rms_um", 0.0)));
    } else if (given.out.empty()) {
      cli::PrintText(result.value("csv", ""));
    }
    return static_cast<int>(ExitCode::kOk);
  });
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
  app->add_option("--units", run.units_path, "units.csv: the fleet");
  app->add_option("--state", run.state_path,
                  "state.csv: where the axes stand at first; folded without");
  app->add_option("--unix-directory", run.unix_directory,
                  "one UNIX socket a bus, bus<ID>.sock, in this directory");
  app->add_option("--bus", given->buses_text,
                  "SocketCAN interfaces by ascending bus_id: vcan0,vcan1 or vcan0...vcan49");
  app->add_option("--control", given->control, "control socket for the subcommands");
  app->add_option("--flash", run.flash_path,
                  "what survives power-off: read at the start where it is, written at the end");
  app->add_option(
      "--faults", run.faults_path,
      "faults.csv: which bus or unit misbehaves how, from when to when; chance by --seed");
  app->add_option("--camera", run.camera_directory,
                  "folder where focalfleetd asks a camera for exposures; it is answered there");
  app->add_option("--fiducials", run.fiducials_path, "fiducials.csv: what the camera sees beside");
  app->add_option("--camera-noise-um", run.camera_noise_um, "of one coordinate of a usual spot")
      ->check(cli::NumberBetween(0, 1000))
      ->capture_default_str();
  app->add_option("--camera-air-um", run.camera_air_um,
                  "turbulence, of one coordinate; nearly the same for neighbours")
      ->check(cli::NumberBetween(0, 1000))
      ->capture_default_str();
  app->add_option("--speed", run.speed, "times faster than life")
      ->check(cli::NumberBetween(0.01, 1000))
      ->capture_default_str();
  app->add_option("--seed", run.seed, "of all chance")->capture_default_str();
  app->add_option("--spread", given->spread,
                  "nominal: units as described; real: the spread of service")
      ->check(CLI::IsMember({"nominal", "real"}))
      ->capture_default_str();
  app->add_option("--plant", given->plant,
                  "CAUSE=SIZE or CAUSE:AXIS=SIZE, on top of the spread; repeat: zero_offset (deg), "
                  "arm_length (mm), gear_scale (share), backlash (deg), eccentricity (deg)");
  app->add_option("--clock-error", given->clock_errors,
                  "UNITS=SHARE: the clocks of these units run that much fast, or slow below 0; "
                  "repeat. Otherwise up to 50 ppm");
  app->add_option("--bit-rate", run.bit_rate_bps, "bit/s of the simulated buses")
      ->check(CLI::Range(10'000, 1'000'000))
      ->capture_default_str();
}

struct Subcommand {
  CLI::App* app;
  std::function<int()> run;
};

CLI::App* AddSubcommand(CLI::App* app, Given* given, const char* name, const char* what) {
  CLI::App* sub = app->add_subcommand(name, what);
  sub->add_option("--control", given->control, "control socket of the running simulation")
      ->required();
  sub->add_flag("--json", given->json, "the result as one line of JSON");
  return sub;
}

CLI::App* AddUnitsSubcommand(CLI::App* app, Given* given, const char* name, const char* what) {
  CLI::App* sub = AddSubcommand(app, given, name, what);
  sub->add_option("--units", given->units_text, "unit ids: 1,2,5-9")->required();
  return sub;
}

CLI::App* AddMisbehave(CLI::App* app, Given* given) {
  CLI::App* sub = AddUnitsSubcommand(app, given, "misbehave",
                                     "units answer wrongly; their motors obey as ever. Ways add up "
                                     "until --off");
  sub->add_option("--late", given->misbehaviour.late_s, "every answer comes so many seconds later")
      ->check(cli::NumberBetween(0, 86'400));
  sub->add_option("--copies", given->misbehaviour.copies, "every answer is sent so many times")
      ->check(CLI::Range(1, 100));
  sub->add_flag("--deaf", given->misbehaviour.deaf, "they hear nothing");
  sub->add_flag("--wrong-digest", given->misbehaviour.wrong_digest,
                "what they say they hold is not what was staged");
  sub->add_flag("--mute-done", given->misbehaviour.mute_done,
                "they never report the end of a motion unasked");
  sub->add_option(
      "--foreign", given->misbehaviour.foreign_serial,
      "other hardware, with this serial number, sits at the place of the one unit; 0: its "
      "number is lost");
  sub->add_flag("--off", given->off, "first: they behave again");
  return sub;
}

std::vector<Subcommand> AddSubcommands(CLI::App* app, Given* given) {
  CLI::App* truth = AddSubcommand(app, given, "truth", "where all axes and fibres truly are");
  truth->add_option("--out", given->out, "truth.csv; without it and --targets: to stdout");
  truth->add_option("--targets", given->targets, "targets.csv: compare the named units with it");
  CLI::App* cut = AddUnitsSubcommand(app, given, "power-cut", "cut the power of units, now");
  cut->add_option("--seconds", given->seconds, "power comes back after so much of the fleet's time")
      ->check(cli::NumberBetween(0, 86'400));
  CLI::App* on = AddUnitsSubcommand(app, given, "power-on", "give units their power back");
  CLI::App* fault = AddUnitsSubcommand(app, given, "fault", "let units fail");
  fault
      ->add_option("--code", given->code,
                   "over_temperature, under_voltage, over_current, flash, driver")
      ->required();
  fault->add_option("--axis", given->axis, "theta or phi")->capture_default_str();
  fault->add_option("--after", given->after_s, "not now: so many seconds into the next motion")
      ->check(cli::NumberBetween(0, 86'400));
  CLI::App* silence =
      AddUnitsSubcommand(app, given, "silence", "units act as told and say nothing");
  silence->add_flag("--off", given->off, "they speak again");
  CLI::App* misbehave = AddMisbehave(app, given);
  CLI::App* kill = AddSubcommand(app, given, "kill-bus", "nothing passes on these buses any more");
  kill->add_option("--buses", given->bus_numbers_text, "bus ids: 1,2,5-9")->required();
  CLI::App* revive = AddSubcommand(app, given, "revive-bus", "these buses work again");
  revive->add_option("--buses", given->bus_numbers_text, "bus ids: 1,2,5-9")->required();
  CLI::App* camera = AddSubcommand(app, given, "camera", "let the next exposures go wrong");
  camera->add_option("--fault", given->code, "dead, late, doubled, turned, other_field, or none")
      ->required();
  camera->add_option("--exposures", given->exposures, "so many")->capture_default_str();
  CLI::App* field = app->add_subcommand(
      "field", "write the field map of the joints' magnets, for `focalfleet hall fit`");
  field->add_option("--out", given->out, "FIELD.csv")->required();
  CLI::App* status = AddSubcommand(app, given, "status", "counters of all buses, as JSON");
  CLI::App* quit =
      AddSubcommand(app, given, "quit", "end the simulation; it writes its FLASH file");

  return {{truth, [given] { return ReportTruth(*given); }},
          {cut,
           [given] {
             Json args = Json::object();
             if (given->seconds >= 0) args["seconds"] = given->seconds;
             return AskAboutUnits(*given, "power_cut", args);
           }},
          {on, [given] { return AskAboutUnits(*given, "power_on", Json::object()); }},
          {fault,
           [given] {
             Json args = {{"code", given->code}, {"axis", given->axis}};
             if (given->after_s >= 0) args["after_s"] = given->after_s;
             return AskAboutUnits(*given, "fault", args);
           }},
          {silence,
           [given] {
             return AskAboutUnits(*given, "silence", {{"off", given->off}});
           }},
          {misbehave, [given] { return Misbehave(*given); }},
          {kill, [given] { return SetBuses(*given, "kill_bus"); }},
          {revive, [given] { return SetBuses(*given, "revive_bus"); }},
          {camera,
           [given] {
             return AskSimply(
                 *given, {0, "camera", {{"fault", given->code}, {"exposures", given->exposures}}});
           }},
          {field, [given] { return WriteField(*given); }},
          {status,
           [given] {
             given->json = true;
             return AskSimply(*given, {0, "status", Json::object()});
           }},
          {quit, [given] {
             return AskSimply(*given, {0, "quit", Json::object()});
           }}};
}

}  // namespace

Result<std::vector<std::string>> ParseInterfaces(const std::string& text) {
  std::vector<std::string> names;
  for (const std::string& piece : Split(text, ',')) {
    const std::size_t dots = piece.find("...");
    if (dots == std::string::npos) {
      if (piece.empty()) return Fail(ErrorCode::kInvalid, "--bus: an interface name is empty");
      names.push_back(piece);
      continue;
    }
    const std::string first = piece.substr(0, dots);
    const std::string last = piece.substr(dots + 3);
    const std::size_t digits = first.find_last_not_of("0123456789") + 1;
    const std::string stem = first.substr(0, digits);
    unsigned low = 0;
    unsigned high = 0;
    if (stem.empty() || last.substr(0, digits) != stem || !Parse(first.substr(digits), &low) ||
        !Parse(last.substr(digits), &high) || high < low || high - low >= kNumbersMax)
      return Fail(ErrorCode::kInvalid, "--bus: '" + piece + "' is no range such as vcan0...vcan49");
    for (unsigned i = low; i <= high; ++i) names.push_back(stem + std::to_string(i));
  }
  return names;
}

int Main(int argc, char** argv) {
  Given given;
  CLI::App app{
      "The simulated fleet: answers on UNIX sockets or SocketCAN interfaces as units do, until "
      "SIGTERM.\n"
      "Says `ready` when all of them are open.",
      "focalfleet-sim"};
  app.footer(kExitCodes);
  app.set_version_flag("--version", FOCALFLEET_VERSION);
  app.require_subcommand(0, 1);
  AddRunOptions(&app, &given);
  const std::vector<Subcommand> subcommands = AddSubcommands(&app, &given);
  // CLI11 is the only library here that throws; its exceptions end here.
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? static_cast<int>(ExitCode::kOk)
                                : static_cast<int>(ExitCode::kUsage);
  }
  for (const Subcommand& subcommand : subcommands) {
    if (!subcommand.app->parsed()) continue;
    const int exit = subcommand.run();
    if (exit != 0 || cli::OutputError() == 0) return exit;
    return Complain({ErrorCode::kUnavailable, std::string("standard output cannot be written: ") +
                                                  std::strerror(cli::OutputError())},
                    ExitCode::kRefused);
  }
  return Run(&given, app);
}

}  // namespace focalfleet::simulator
