#include "daemon/simulator/subcommands.h"

#include <fmt/format.h>

#include <cstdio>

#include "daemon/cli/command_line.h"
#include "daemon/cli/context.h"
#include "daemon/control/id_ranges.h"
#include "daemon/control/line_client.h"
#include "daemon/control/printable.h"
#include "daemon/files/text_file.h"
#include "daemon/tables/read_table.h"
#include "sim/hall/fibre_carrier.h"

namespace focalfleet::simulator {
namespace {

using cli::ExitCode;

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
    const auto text = ReadTableAsText(given.targets, "unit_id");
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

/// Each example is the rest of a line behind the name of the command.
CLI::App* AddSubcommand(CLI::App* app, Given* given, const char* name, const char* what,
                        const char* example = "") {
  CLI::App* sub = app->add_subcommand(name, what);
  sub->footer(fmt::format("  focalfleet-sim {} --control sim.sock{}{}", name,
                          *example == '\0' ? "" : " ", example));
  sub->add_option("--control", given->control, "Control socket of the running simulation")
      ->required()
      ->type_name("FILE");
  sub->add_flag("--json", given->json, "The result as one line of JSON");
  return sub;
}

CLI::App* AddUnitsSubcommand(CLI::App* app, Given* given, const char* name, const char* what,
                             const char* example) {
  CLI::App* sub = AddSubcommand(app, given, name, what, example);
  sub->add_option("--units", given->units_text, "unit_ids: 1,2,5-9")->required()->type_name("LIST");
  return sub;
}

CLI::App* AddMisbehave(CLI::App* app, Given* given) {
  CLI::App* sub = AddUnitsSubcommand(app, given, "misbehave",
                                     "Let units answer wrongly while their motors obey; ways add "
                                     "up until --off",
                                     "--units 7,20-25 --late 0.2 --copies 2");
  sub->add_option("--late", given->misbehaviour.late_s, "Every answer comes so many seconds later")
      ->check(cli::NumberBetween(0, 86'400));
  sub->add_option("--copies", given->misbehaviour.copies, "Every answer is sent so many times")
      ->check(CLI::Range(1, 100));
  sub->add_flag("--deaf", given->misbehaviour.deaf, "They hear nothing");
  sub->add_flag("--wrong-digest", given->misbehaviour.wrong_digest,
                "The move that they report to hold is not the staged one");
  sub->add_flag("--mute-done", given->misbehaviour.mute_done,
                "They never report the end of a motion unasked");
  sub->add_option(
      "--foreign", given->misbehaviour.foreign_serial,
      "Other hardware, with this serial number, is at the place of the single unit; 0: its "
      "number is lost");
  sub->add_flag("--off", given->off, "First: they behave again");
  return sub;
}

using Subcommands = std::vector<Subcommand>;

void AddQuestions(CLI::App* app, Given* given, Subcommands* list) {
  CLI::App* truth = AddSubcommand(app, given, "truth", "Show where all axes and fibres truly are",
                                  "--targets targets.csv");
  truth->add_option("--out", given->out, "truth.csv to write (otherwise stdout, without --targets)")
      ->type_name("FILE");
  truth->add_option("--targets", given->targets, "targets.csv: compare the named units with it")
      ->type_name("FILE");
  list->push_back({truth, [given] { return ReportTruth(*given); }});
  CLI::App* field = app->add_subcommand(
      "field", "Write the field map of the joints' magnets, for focalfleet hall fit");
  field->footer("  focalfleet-sim field --out field.csv");
  field->add_option("--out", given->out, "field.csv to write")->required()->type_name("FILE");
  list->push_back({field, [given] { return WriteField(*given); }});
  CLI::App* status = AddSubcommand(app, given, "status", "Show the counters of all buses, as JSON");
  list->push_back({status, [given] {
                     given->json = true;
                     return AskSimply(*given, {0, "status", Json::object()});
                   }});
}

void AddFaultsOfUnits(CLI::App* app, Given* given, Subcommands* list) {
  CLI::App* cut = AddUnitsSubcommand(app, given, "power-cut", "Cut the power of units, now",
                                     "--units 7,20-25 --seconds 10");
  cut->add_option("--seconds", given->seconds,
                  "Power comes back after so many seconds of the fleet's time")
      ->check(cli::NumberBetween(0, 86'400));
  list->push_back({cut, [given] {
                     Json args = Json::object();
                     if (given->seconds >= 0) args["seconds"] = given->seconds;
                     return AskAboutUnits(*given, "power_cut", args);
                   }});
  CLI::App* on =
      AddUnitsSubcommand(app, given, "power-on", "Give units their power back", "--units 7");
  list->push_back({on, [given] { return AskAboutUnits(*given, "power_on", Json::object()); }});
  CLI::App* fault = AddUnitsSubcommand(app, given, "fault", "Let units fail",
                                       "--units 7 --code flash --axis phi");
  fault->add_option("--code", given->code, "The fault")
      ->required()
      ->type_name("{over_temperature,under_voltage,over_current,flash,driver}");
  fault->add_option("--axis", given->axis, "The axis that has it")
      ->type_name("{theta,phi}")
      ->capture_default_str();
  fault
      ->add_option("--after", given->after_s,
                   "So many seconds into the next motion (otherwise now)")
      ->check(cli::NumberBetween(0, 86'400));
  list->push_back({fault, [given] {
                     Json args = {{"code", given->code}, {"axis", given->axis}};
                     if (given->after_s >= 0) args["after_s"] = given->after_s;
                     return AskAboutUnits(*given, "fault", args);
                   }});
  CLI::App* silence =
      AddUnitsSubcommand(app, given, "silence", "Let units obey and say nothing", "--units 7");
  silence->add_flag("--off", given->off, "They speak again");
  list->push_back({silence, [given] {
                     return AskAboutUnits(*given, "silence", {{"off", given->off}});
                   }});
  list->push_back({AddMisbehave(app, given), [given] { return Misbehave(*given); }});
}

void AddBusSubcommand(CLI::App* app, Given* given, const char* name, const char* what,
                      const char* verb, Subcommands* list) {
  CLI::App* sub = AddSubcommand(app, given, name, what, "--buses 2");
  sub->add_option("--buses", given->bus_numbers_text, "bus_ids: 1,2,5-9")
      ->required()
      ->type_name("LIST");
  list->push_back({sub, [given, verb] { return SetBuses(*given, verb); }});
}

void AddCamera(CLI::App* app, Given* given, Subcommands* list) {
  CLI::App* camera = AddSubcommand(app, given, "camera", "Let the next exposures go wrong",
                                   "--fault late --exposures 2");
  camera->add_option("--fault", given->code, "The fault")
      ->required()
      ->type_name("{dead,late,doubled,turned,other_field,none}");
  camera->add_option("--exposures", given->exposures, "Exposures that have it")
      ->capture_default_str();
  list->push_back({camera, [given] {
                     return AskSimply(
                         *given,
                         {0, "camera", {{"fault", given->code}, {"exposures", given->exposures}}});
                   }});
}

}  // namespace

int Complain(const Error& error, ExitCode code) {
  std::fprintf(stderr, "focalfleet-sim: %s\n", PrintableLines(error.text).c_str());
  return static_cast<int>(code);
}

std::vector<Subcommand> AddSubcommands(CLI::App* app, Given* given) {
  Subcommands list;
  AddQuestions(app, given, &list);
  AddFaultsOfUnits(app, given, &list);
  AddBusSubcommand(app, given, "kill-bus", "Let nothing pass on buses any more", "kill_bus", &list);
  AddBusSubcommand(app, given, "revive-bus", "Let buses work again", "revive_bus", &list);
  AddCamera(app, given, &list);
  CLI::App* quit =
      AddSubcommand(app, given, "quit", "End the simulation, which writes its FLASH file");
  list.push_back({quit, [given] { return AskSimply(*given, {0, "quit", Json::object()}); }});
  list.push_back(
      {soak::AddSoak(app, &given->soak), [given] { return soak::RunSoak(given->soak); }});
  return list;
}

}  // namespace focalfleet::simulator
