// The commands home, measure, disable, enable, adopt and params act on single units.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/configuration_summary.h"
#include "daemon/cli/confirm.h"
#include "daemon/cli/each_unit.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/cli/unit_choice.h"
#include "daemon/control/id_ranges.h"
#include "protocol/wire/messages.h"

namespace focalfleet::cli {
namespace {

constexpr std::size_t kRangesShown = 10;

ExitCode ReportConfiguration(const Context& context, const Json& configuration) {
  Say(context, DescribeConfiguration(configuration, context.colour_out));
  const ExitCode exit = ExitCodeOf(configuration);
  if (exit == ExitCode::kSomeUnserved) NameUnserved(context, DescribeNotServed(configuration));
  return exit;
}

// Prints the answer with --json, else `done`.
ExitCode PrintAnswer(const Context& context, const tl::expected<Json, Failure>& answer,
                     const std::string& done) {
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  Say(context, done);
  return ExitCode::kOk;
}

void AddYes(CLI::App* command, bool* yes) {
  command->add_flag("--yes", *yes, "Do not ask on a terminal");
}

// ---- home

struct HomeOptions {
  UnitChoice choice;
  bool not_known = false;
  bool unproven = false;
  bool yes = false;
  bool wait = false;
};

ExitCode RunHome(const Context& context, const HomeOptions& options) {
  if (options.choice.empty() != options.not_known) {
    return Report(context,
                  {ErrorCode::kInvalid, "home: name units, or say --not-known (one of the two)"},
                  ExitCode::kUsage);
  }
  if (options.unproven) {
    constexpr const char* kWhat =
        "homing without proof that the neighbours are out of the way: arms may touch";
    if (const auto refused = Refused(kWhat, options.yes)) return Report(context, *refused);
  }
  Json args{{"wait", options.wait}, {"unproven", options.unproven}};
  if (options.not_known) {
    args["not_known"] = true;
  } else {
    const auto units = ChosenUnits(context, options.choice);
    if (!units) return Report(context, units.error());
    args["unit_ids"] = *units;
  }
  ProgressBar bar(context);
  const auto answer = Ask(context, {.verb = "home",
                                    .args = args,
                                    .long_lasting = options.wait,
                                    .on_progress = [&bar](const Json& p) {
                                      bar.Show(NumberIn(p, "fraction"), DescribeStage(p),
                                               fmt::format("{} of {} homed", CountIn(p, "arrived"),
                                                           CountIn(p, "targeted")));
                                    }});
  bar.End();
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  if (!options.wait) {
    Say(context, "homing begins; `focalfleet status` shows how it goes");
    return ExitCode::kOk;
  }
  return ReportConfiguration(context, *answer);
}

void AddHome(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "home", "Drive units to their hard stops, so that their place is known",
      "  focalfleet home 4711,4720-4725 --wait\n  focalfleet home --bus 3 --state unknown --wait\n"
      "  focalfleet home --not-known --wait");
  auto options = std::make_shared<HomeOptions>();
  AddUnitChoice(command, &options->choice);
  command->add_flag("--not-known", options->not_known, "All units whose place is not known");
  command->add_flag(
      "--unproven", options->unproven,
      "Home also where no way can be proven clear of the neighbours: your word for it");
  command->add_flag("--wait", options->wait, "Wait until it is over");
  AddYes(command, &options->yes);
  OnChosen(line, command, options, RunHome);
}

// ---- measure

struct MeasureOptions {
  bool wait = false;
};

ExitCode RunMeasure(const Context& context, const MeasureOptions& options) {
  ProgressBar bar(context);
  const auto answer = Ask(context, {.verb = "measure",
                                    .args = {{"wait", options.wait}},
                                    .long_lasting = options.wait,
                                    .on_progress = [&bar](const Json& p) {
                                      bar.Show(NumberIn(p, "fraction"), DescribeStage(p), "");
                                    }});
  bar.End();
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  if (!options.wait) {
    Say(context, "an exposure is asked for; `focalfleet status` shows what it finds");
    return ExitCode::kOk;
  }
  return ReportConfiguration(context, *answer);
}

void AddMeasure(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "measure", "Look with the camera where every fibre is; nothing moves",
                 "  focalfleet measure --wait    # find units of unknown place, among others\n"
                 "  focalfleet measurements --out fibres.fits");
  auto options = std::make_shared<MeasureOptions>();
  command->add_flag("--wait", options->wait, "Wait for the exposure, and tell what it found");
  OnChosen(line, command, options, RunMeasure);
}

// ---- disable, enable, adopt

struct EnableOptions {
  UnitChoice choice;
  std::string reason;
  bool yes = false;
  double within_s = 5;  // a unit that clears a fault is read anew, within seconds with repeats
};

ExitCode RunDisable(const Context& context, const EnableOptions& options) {
  const auto units = ChosenUnits(context, options.choice);
  if (!units) return Report(context, units.error());
  if (units->size() > kUnitsUnasked) {
    const std::string what = fmt::format("{} units are disabled ({})", units->size(),
                                         DescribeRanges(*units, kRangesShown));
    if (const auto refused = Refused(what, options.yes)) return Report(context, *refused);
  }
  return PrintAnswer(
      context,
      Ask(context, {.verb = "disable", .args = {{"unit_ids", *units}, {"reason", options.reason}}}),
      fmt::format("{} disabled", Count(units->size(), "unit", "units")));
}

constexpr std::chrono::milliseconds kLookEvery{50};

/// The units that are still in fault when the daemon has had time to clear it.
/// Errors: as Ask.
tl::expected<std::vector<std::uint32_t>, Failure> StillInFault(
    const Context& context, const std::vector<std::uint32_t>& units, double within_s) {
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::duration<double>(within_s);
  for (;;) {
    std::vector<std::uint32_t> faulty;
    for (const std::uint32_t id : units) {
      const auto unit = Ask(context, {.verb = "unit", .args = {{"unit_id", id}}});
      if (!unit) return tl::unexpected(unit.error());
      const std::string phase = TextIn(*unit, "phase");
      if (phase == "fault" || phase == "identifying") faulty.push_back(id);
    }
    if (faulty.empty() || std::chrono::steady_clock::now() >= give_up) return faulty;
    std::this_thread::sleep_for(kLookEvery);
  }
}

ExitCode RunEnable(const Context& context, const EnableOptions& options) {
  const auto units = ChosenUnits(context, options.choice);
  if (!units) return Report(context, units.error());
  const auto answer = Ask(context, {.verb = "enable", .args = {{"unit_ids", *units}}});
  if (!answer) return Report(context, answer.error());
  const auto faulty = StillInFault(context, *units, options.within_s);
  if (!faulty) return Report(context, faulty.error());
  if (context.json) {
    Json result = *answer;
    result["still_in_fault"] = *faulty;
    PrintJson(result);
  }
  Say(context, fmt::format("{} enabled", Count(units->size(), "unit", "units")));
  if (faulty->empty()) return ExitCode::kOk;
  Complain(fmt::format("focalfleet: still in fault: {} (`focalfleet unit {}` says which)\n",
                       fmt::join(*faulty, ", "), faulty->front()));
  return ExitCode::kSomeUnserved;
}

void AddEnable(CommandLine* line) {
  CLI::App* disable = AddCommand(
      &line->app, "disable", "Take units out: they stand where they are, obstacles to the others",
      "  focalfleet disable 4711 --reason 'phi stalls'\n"
      "  focalfleet disable --bus 3 --reason 'cable is off' --yes");
  auto taken_out = std::make_shared<EnableOptions>();
  AddUnitChoice(disable, &taken_out->choice);
  disable->add_option("--reason", taken_out->reason, "Why, for those who come after")->required();
  AddYes(disable, &taken_out->yes);
  OnChosen(line, disable, taken_out, RunDisable);

  CLI::App* enable =
      AddCommand(&line->app, "enable", "Take units in again; of a unit in fault, clear the fault",
                 "  focalfleet enable 4711\n  focalfleet enable --state fault");
  auto taken_in = std::make_shared<EnableOptions>();
  AddUnitChoice(enable, &taken_in->choice);
  enable->add_option("--within-s", taken_in->within_s, "How long to wait for faults to be cleared")
      ->check(NumberBetween(0, 600))
      ->capture_default_str();
  OnChosen(line, enable, taken_in, RunEnable);
}

struct AdoptOptions {
  UnitChoice choice;
  bool yes = false;
};

ExitCode RunAdopt(const Context& context, const AdoptOptions& options) {
  const auto units = ChosenUnits(context, options.choice);
  if (!units) return Report(context, units.error());
  const std::string what =
      fmt::format("the hardware that answers at {} ({}) becomes their own",
                  Count(units->size(), "unit", "units"), DescribeRanges(*units, kRangesShown));
  if (const auto refused = Refused(what, options.yes)) return Report(context, *refused);
  const auto tell = [&context](std::uint32_t id, Json* answer) {
    std::string done =
        fmt::format("unit {}: the hardware that answers there belongs there now", id);
    if (const std::string text = TextIn(*answer, "text"); text.starts_with("done"))
      done += text.substr(4);
    Say(context, done);
    return true;
  };
  return AskForEach(context, *units, {.verb = "adopt", .tell = tell});
}

void AddAdopt(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "adopt", "Accept the serial number that answers at a unit's place as its own",
      "  focalfleet unit 4711    # shows both serial numbers\n  focalfleet adopt 4711 --yes");
  auto options = std::make_shared<AdoptOptions>();
  AddUnitChoice(command, &options->choice);
  AddYes(command, &options->yes);
  OnChosen(line, command, options, RunAdopt);
}

// ---- params

struct ParamsOptions {
  std::string units;  // as 7,20-25
  std::string action;
  std::string axis;
  std::string name;
  std::optional<std::int32_t> value;
  bool yes = false;
};

std::vector<std::string> ParameterNames() {
  std::vector<std::string> names;
  for (std::uint8_t i = 0; i < kParameterCount; ++i) {
    names.emplace_back(focalfleet::Name(static_cast<Parameter>(i)));
  }
  return names;
}

ExitCode SetParameter(const Context& context, const ParamsOptions& options,
                      const std::vector<std::uint32_t>& units) {
  if (units.size() > kUnitsUnasked) {
    const std::string what =
        fmt::format("{} {} becomes {} in {} units ({})", options.axis, options.name, *options.value,
                    units.size(), DescribeRanges(units, kRangesShown));
    if (const auto refused = Refused(what, options.yes)) return Report(context, *refused);
  }
  // The unit decides: it may hold another value than the requested one.
  const auto tell = [&context](std::uint32_t, Json* answer) {
    Say(context, TextIn(*answer, "text"));
    return true;
  };
  return AskForEach(
      context, units,
      {.verb = "params_set",
       .args = {{"axis", options.axis}, {"parameter", options.name}, {"value", *options.value}},
       .tell = tell});
}

// The rows of stored or set parameters, then those of the defaults, narrowed to one axis and name
// where given.
Json ParameterRows(const Json& answer, const ParamsOptions& options) {
  Json rows = Json::array();
  const auto wanted = [&](const std::string& axis, const std::string& name) {
    return (options.axis.empty() || options.axis == axis) &&
           (options.name.empty() || options.name == name);
  };
  for (const Json& row : ListIn(answer, "parameters")) {
    if (wanted(TextIn(row, "axis"), TextIn(row, "parameter"))) rows.push_back(row);
  }
  const Json& drive = ObjectIn(answer, "drive");
  for (const Axis axis : kAxes) {
    for (const std::string& name : ParameterNames()) {
      const std::string key = std::string(focalfleet::Name(axis)) + "_" + name;
      const bool stored = std::any_of(rows.begin(), rows.end(), [&](const Json& row) {
        return TextIn(row, "axis") == focalfleet::Name(axis) && TextIn(row, "parameter") == name;
      });
      if (stored || !drive.contains(key) || !wanted(focalfleet::Name(axis), name)) continue;
      rows.push_back({{"axis", focalfleet::Name(axis)},
                      {"parameter", name},
                      {"value", drive[key]},
                      {"origin", "default"}});
    }
  }
  return rows;
}

// The result of the last tuning, for human readers; empty where the unit was never tuned.
std::string DescribeTuning(const Json& answer, const ParamsOptions& options) {
  Json rows = Json::array();
  for (Json row : ListIn(answer, "tuning")) {
    if (!options.axis.empty() && options.axis != TextIn(row, "axis")) continue;
    row["margin"] = fmt::format("{:.2f}", NumberIn(row, "margin"));
    row["load_uNm"] = fmt::format("{:.2f}", NumberIn(row, "load_uNm"));
    row["v_bus_V"] = fmt::format("{:g}", NumberIn(row, "v_bus_V"));
    rows.push_back(std::move(row));
  }
  if (rows.empty()) return "";
  return "\ntuned from rest:\n" +
         DescribeRows(rows, {"axis", "critical", "repeat", "margin", "load_uNm", "v_bus_V", "mode",
                             "origin", "at"});
}

ExitCode RunParams(const Context& context, const ParamsOptions& options) {
  const bool set = options.action == "set";
  const bool complete = !options.axis.empty() && !options.name.empty() && options.value.has_value();
  if (set != options.value.has_value() || (set && !complete)) {
    return Report(context,
                  {ErrorCode::kInvalid,
                   "params: use `params UNIT`, `params UNIT get [AXIS [NAME]]` or `params UNIT set "
                   "AXIS NAME VALUE`"},
                  ExitCode::kUsage);
  }
  const auto units = ParseRanges(options.units);
  if (!units) return Report(context, units.error(), ExitCode::kUsage);
  if (set) return SetParameter(context, options, *units);
  const auto tell = [&](std::uint32_t id, Json* answer) {
    const Json rows = ParameterRows(*answer, options);
    const std::string tuning = options.name.empty() ? DescribeTuning(*answer, options) : "";
    Say(context, (units->size() > 1 ? fmt::format("unit {}\n", id) : std::string()) +
                     (rows.empty() ? "nothing is known of it: neither set nor read from the unit"
                                   : DescribeRows(rows, {"axis", "parameter", "value", "origin"})) +
                     tuning);
    (*answer)["parameters"] = rows;
    return true;
  };
  return AskForEach(context, *units, {.verb = "params", .tell = tell});
}

void AddParams(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "params", "Show or set the tuned parameters of units",
                 "  focalfleet params 4711\n  focalfleet params 4711 get theta repeat\n"
                 "  focalfleet params 4711 set theta repeat 54");
  auto options = std::make_shared<ParamsOptions>();
  command->add_option("UNIT", options->units, "Its unit_id, or 7,20-25")->required();
  OneOf(command->add_option("ACTION", options->action, "Show (default) or set"), {"get", "set"});
  OneOf(command->add_option("AXIS", options->axis, "Which axis"), {"theta", "phi"});
  OneOf(command->add_option("NAME", options->name, "Which parameter"), ParameterNames());
  command->add_option("VALUE", options->value, "Its new value, a whole number");
  AddYes(command, &options->yes);
  OnChosen(line, command, options, RunParams);
}

}  // namespace

void AddUnitCommands(CommandLine* line) {
  AddHome(line);
  AddMeasure(line);
  AddEnable(line);
  AddAdopt(line);
  AddParams(line);
}

}  // namespace focalfleet::cli
