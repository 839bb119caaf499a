// The commands status, unit, state and history are questions that change nothing.

#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/configuration_summary.h"
#include "daemon/cli/each_unit.h"
#include "daemon/cli/table.h"
#include "daemon/cli/time_text.h"
#include "daemon/cli/unit_choice.h"
#include "daemon/cli/versions.h"
#include "daemon/files/fits_table.h"
#include "daemon/files/text_file.h"

namespace focalfleet::cli {
namespace {

// ---- status

struct StatusOptions {
  bool buses = false;
  std::optional<std::uint32_t> sector;
};

std::string Counted(const Json& counts) {
  std::string text;
  for (const auto& [name, count] : counts.items()) {
    if (!count.is_number_unsigned() || count.get<std::uint64_t>() == 0) continue;
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count.get<std::uint64_t>(), name);
  }
  return text.empty() ? "none" : text;
}

std::string DescribeBus(const Json& bus, bool colour_on) {
  const std::string link = TextIn(bus, "link");
  const std::string trouble = TextIn(bus, "trouble");
  return fmt::format(
      "  bus {}: {}{}, load {:.0f} % (highest {:.0f} %), {} sent, {} received, {} malformed, {} "
      "retries\n",
      CountIn(bus, "bus_id"), Paint(colour_on, link == "up" ? Colour::kGreen : Colour::kRed, link),
      trouble.empty() ? "" : fmt::format(" ({}: {})", TextIn(bus, "port"), trouble),
      100 * NumberIn(bus, "load"), 100 * NumberIn(bus, "load_max"), CountIn(bus, "frames_sent"),
      CountIn(bus, "frames_received"), CountIn(bus, "malformed"), CountIn(bus, "retries"));
}

// Healthy buses are only counted, unless the caller asks for all.
std::string DescribeBuses(const Json& buses, double load_max, bool all, bool colour_on) {
  std::size_t up = 0;
  std::string lines;
  for (const Json& bus : buses) {
    const bool healthy = TextIn(bus, "link") == "up";
    up += healthy ? 1u : 0u;
    if (all || !healthy) lines += DescribeBus(bus, colour_on);
  }
  return fmt::format("buses      {} of {} up, highest load {:.0f} %\n{}", up, buses.size(),
                     100 * load_max, lines);
}

/// Nothing where none is open or muted.
std::string DescribeOpenAlarms(const Json& alarms, bool colour_on) {
  const std::uint64_t open = CountIn(alarms, "open");
  const std::uint64_t muted = CountIn(alarms, "muted");
  if (open + muted == 0) return "";
  const Colour colour = TextIn(alarms, "worst") == "error" ? Colour::kRed : Colour::kYellow;
  std::string text =
      open == 0 ? "none open" : Paint(colour_on, colour, fmt::format("{} open", open));
  if (muted > 0) text += fmt::format(", {} muted", muted);
  return fmt::format("alarms     {} (`focalfleet alarms`)\n", text);
}

std::string DescribeStatus(const Json& status, const StatusOptions& options, bool colour_on) {
  const bool busy = status.value("busy", false);
  const Json& store = ObjectIn(status, "store");
  const bool failing = store.value("failing", false);
  std::string text = fmt::format(
      "focalfleetd {}, {}\n", TextIn(status, "version"),
      busy ? Paint(colour_on, Colour::kYellow, "busy") : Paint(colour_on, Colour::kGreen, "idle"));
  if (const std::string difference = DifferenceFrom(TextIn(status, "version")); !difference.empty())
    text += fmt::format("version    {}\n", Paint(colour_on, Colour::kYellow, difference));
  text += fmt::format("units      {}, {} enabled: {}\n", CountIn(status, "units"),
                      CountIn(status, "enabled"), Counted(ObjectIn(status, "phases")));
  text += fmt::format("positions  {}\n", Counted(ObjectIn(status, "positions")));
  text += fmt::format(
      "store      {}{}\n", TextIn(store, "path"),
      failing ? Paint(colour_on, Colour::kRed, "  FAILING: nothing new is started") : "");
  if (const std::string trouble = TextIn(ObjectIn(status, "dds"), "trouble"); !trouble.empty())
    text += fmt::format("dds        {} {}\n", Paint(colour_on, Colour::kRed, "MISSING"), trouble);
  text += DescribeOpenAlarms(ObjectIn(status, "alarms"), colour_on);
  text += DescribeBuses(ListIn(status, "buses"), NumberIn(status, "bus_load_max"), options.buses,
                        colour_on);
  const Json& configuration = ObjectIn(status, "configuration");
  text += CountIn(configuration, "id") == 0 ? "no configuration yet"
                                            : DescribeConfiguration(configuration, colour_on);
  if (const std::string next = TextIn(status, "next"); !next.empty()) text += "\nnext: " + next;
  return text;
}

std::string DescribeSector(const Json& sector, bool colour_on) {
  const std::string trouble = TextIn(sector, "trouble");
  std::string text = fmt::format("  sector {}: {} units, {}", CountIn(sector, "sector"),
                                 CountIn(sector, "units"), TextIn(sector, "stage"));
  if (CountIn(sector, "targeted") > 0)
    text +=
        fmt::format(", {} of {} arrived", CountIn(sector, "arrived"), CountIn(sector, "targeted"));
  text += ", clock known to " + Shown(sector, "clock_bound_ms", "ms", 2);
  if (!trouble.empty()) text += ", " + Paint(colour_on, Colour::kRed, "it " + trouble);
  if (const std::string word = TextIn(sector, "last_word"); !word.empty())
    text += " (" + word + ")";
  return text + "\n";
}

/// The status of the coordinator of a plane.
std::string DescribePlane(const Json& status, bool colour_on) {
  const Json& plane = ObjectIn(status, "plane");
  const Json& configuration = ObjectIn(status, "configuration");
  std::string text =
      fmt::format("focalfleetd {}, coordinator of {} units in {} sectors: {}, epoch {}\n",
                  TextIn(status, "version"), CountIn(status, "units"),
                  ListIn(plane, "sectors").size(), TextIn(plane, "phase"), CountIn(plane, "epoch"));
  if (const std::string waits = TextIn(plane, "waiting_for"); !waits.empty())
    text += "waits for  " + Paint(colour_on, Colour::kYellow, waits) + "\n";
  for (const Json& sector : ListIn(plane, "sectors")) text += DescribeSector(sector, colour_on);
  text += DescribeOpenAlarms(ObjectIn(status, "alarms"), colour_on);
  if (CountIn(configuration, "id") == 0) return text + "no configuration yet";
  const Json& guarantee = ObjectIn(configuration, "guarantee");
  text += fmt::format(
      "configuration {} ({}): {}, round {}\n  {} of {} units arrived, {} refused, {} failed, {} "
      "stopped, {} in sectors that were left out\n",
      CountIn(configuration, "id"), TextIn(configuration, "source"), TextIn(configuration, "state"),
      CountIn(configuration, "round"), CountIn(configuration, "arrived"),
      CountIn(configuration, "targeted"), CountIn(configuration, "refused"),
      CountIn(configuration, "failed"), CountIn(configuration, "stopped"),
      CountIn(configuration, "left_out"));
  return text + fmt::format(
                    "  {} pairs follow each other across borders, {} of them beyond the "
                    "notice",
                    CountIn(guarantee, "follows_beyond"), ListIn(guarantee, "unnoticed").size());
}

ExitCode RunStatus(const Context& context, const StatusOptions& options) {
  auto status = Ask(context, {.verb = "status"});
  if (!status) return Report(context, status.error());
  if (options.sector) {
    const Json& sectors = ListIn(ObjectIn(*status, "plane"), "sectors");
    if (*options.sector >= sectors.size())
      return Report(context, {ErrorCode::kInvalid,
                              fmt::format("--sector {}: this daemon coordinates {} sectors",
                                          *options.sector, sectors.size())});
    const Json sector = sectors[*options.sector];
    if (context.json) PrintJson(sector);
    Say(context, DescribeSector(sector, context.colour_out));
    return ExitCode::kOk;
  }
  (*status)["client_version"] = ClientVersion();
  if (context.json) PrintJson(*status);
  Say(context, status->contains("plane") ? DescribePlane(*status, context.colour_out)
                                         : DescribeStatus(*status, options, context.colour_out));
  return ExitCode::kOk;
}

void AddStatus(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "status", "Show the fleet, its buses and its configuration",
                 "  focalfleet status\n  focalfleet status --json");
  auto options = std::make_shared<StatusOptions>();
  command->add_flag("--buses", options->buses,
                    "A line for every bus, not only for those in trouble");
  command->add_option("--sector", options->sector,
                      "Of a plane: this sector alone, by its number from 0");
  OnChosen(line, command, options, RunStatus);
}

// ---- unit

ExitCode RunUnit(const Context& context, const UnitChoice& choice) {
  const auto ids = ChosenUnits(context, choice);
  if (!ids) return Report(context, ids.error());
  bool first = true;
  const auto tell = [&](std::uint32_t, Json* answer) {
    Say(context, (std::exchange(first, false) ? "" : "\n") + DescribeObject(*answer));
    return true;
  };
  return AskForEach(context, *ids, {.verb = "unit", .tell = tell});
}

void AddUnit(CommandLine* line) {
  CLI::App* command = AddCommand(&line->app, "unit", "Show all that is known of units",
                                 "  focalfleet unit 4711\n  focalfleet unit --state fault");
  auto choice = std::make_shared<UnitChoice>();
  AddUnitChoice(command, choice.get());
  OnChosen(line, command, choice, RunUnit);
}

// ---- state

struct StateOptions {
  std::string out;
  bool allow_unknown = false;
};

bool IsPlaceWitness(const std::string& witness) {
  return witness == "measured" || witness == "reported";
}

struct StateFile {
  std::string csv = "unit_id,theta_deg,phi_deg\n";
  std::size_t rows = 0;
  Json unknown = Json::array();  // objects {unit_id, theta, phi} with the witnesses
};

StateFile MakeStateFile(const Json& rows) {
  StateFile file;
  for (const Json& row : rows) {
    const std::uint64_t id = CountIn(row, "unit_id");
    const std::string theta = TextIn(row, "theta_witness");
    const std::string phi = TextIn(row, "phi_witness");
    if (IsPlaceWitness(theta) && IsPlaceWitness(phi)) {
      ++file.rows;
      file.csv += fmt::format("{},{},{}\n", id, NumberIn(row, "theta_low_deg"),
                              NumberIn(row, "phi_low_deg"));
    } else {
      // The row is omitted instead of guessed: a reader then sees that the position is not known.
      file.csv += fmt::format("# unit {} left out: theta {}, phi {}\n", id, theta, phi);
      file.unknown.push_back({{"unit_id", id}, {"theta", theta}, {"phi", phi}});
    }
  }
  return file;
}

std::string NameUnknown(const Json& unknown) {
  constexpr std::size_t kShown = 10;
  std::string text;
  for (std::size_t i = 0; i < unknown.size() && i < kShown; ++i) {
    text +=
        fmt::format("{}{} (theta {}, phi {})", i == 0 ? "" : ", ", CountIn(unknown[i], "unit_id"),
                    TextIn(unknown[i], "theta"), TextIn(unknown[i], "phi"));
  }
  if (unknown.size() > kShown) text += fmt::format(" and {} more", unknown.size() - kShown);
  return text;
}

double NumberOrNan(const Json& row, const char* key) {
  const auto found = row.find(key);
  return found != row.end() && found->is_number() ? found->get<double>() : std::nan("");
}

/// Where all fibres are, for pipelines; docs/files.md. A unit of unknown place has no numbers.
FitsTable PlacesOf(const Json& rows) {
  std::vector<std::int64_t> units, sectors;
  std::vector<double> x, y, target_x, target_y, age;
  std::vector<std::string> theta, phi, outcome;
  for (const Json& row : rows) {
    units.push_back(static_cast<std::int64_t>(CountIn(row, "unit_id")));
    sectors.push_back(row.contains("sector") ? static_cast<std::int64_t>(CountIn(row, "sector"))
                                             : -1);
    target_x.push_back(NumberOrNan(row, "target_x_mm"));
    target_y.push_back(NumberOrNan(row, "target_y_mm"));
    x.push_back(NumberOrNan(row, "x_mm"));
    y.push_back(NumberOrNan(row, "y_mm"));
    theta.push_back(TextIn(row, "theta_witness"));
    phi.push_back(TextIn(row, "phi_witness"));
    outcome.push_back(TextIn(row, "outcome"));
    age.push_back(NumberOrNan(row, "age_s"));
  }
  return {.name = "PLACES",
          .keys = {{"ORIGIN", std::string("focalfleet"), ""}},
          .columns = {{"UNIT_ID", "", std::move(units)},
                      {"SECTOR", "", std::move(sectors)},
                      {"TARGET_X_MM", "mm", std::move(target_x)},
                      {"TARGET_Y_MM", "mm", std::move(target_y)},
                      {"X_MM", "mm", std::move(x)},
                      {"Y_MM", "mm", std::move(y)},
                      {"THETA_WITNESS", "", std::move(theta)},
                      {"PHI_WITNESS", "", std::move(phi)},
                      {"OUTCOME", "", std::move(outcome)},
                      {"AGE_S", "s", std::move(age)}}};
}

ExitCode RunState(const Context& context, const StateOptions& options) {
  const auto state = Ask(context, {.verb = "state"});
  if (!state) return Report(context, state.error());
  const StateFile file = MakeStateFile(ListIn(*state, "rows"));
  const bool as_fits = options.out.ends_with(".fits");
  if (!file.unknown.empty() && !options.allow_unknown && !as_fits) {
    return Report(
        context,
        {ErrorCode::kRefused,
         fmt::format("the place of {} is not known: {}; wait until they rest, home them "
                     "(`focalfleet home --not-known`), or leave them out with "
                     "--allow-unknown",
                     Count(file.unknown.size(), "unit", "units"), NameUnknown(file.unknown))});
  }
  const bool to_file = !options.out.empty() && !context.stdout_is_file;
  if (to_file) {
    const Status written = as_fits ? WriteFitsTable(options.out, PlacesOf(ListIn(*state, "rows")))
                                   : WriteFileAtomically(options.out, file.csv);
    if (!written) return Report(context, written.error());
  }
  if (context.json) {
    PrintJson({{"units", file.rows},
               {"out", options.out},
               {"unknown", file.unknown},
               {"rows", ListIn(*state, "rows")}});
  } else if (!to_file) {
    PrintText(file.csv);
  } else {
    Say(context,
        fmt::format("{}: {}", options.out,
                    Count(file.rows + (as_fits ? file.unknown.size() : 0), "unit", "units")));
  }
  if (file.unknown.empty()) return ExitCode::kOk;
  if (!context.json) {
    Complain(fmt::format("focalfleet: {}: {}\n", as_fits ? "of unknown place" : "left out",
                         NameUnknown(file.unknown)));
  }
  return ExitCode::kSomeUnserved;
}

void AddState(CommandLine* line) {
  CLI::App* command = AddCommand(
      &line->app, "state", "Write where every axis stands as state.csv",
      "  focalfleet state --out state.csv\n"
      "  focalfleet plan --units units.csv --targets t.csv --from state.csv --out plan.csv");
  auto options = std::make_shared<StateOptions>();
  AddFile(command, "--out", &options->out,
          "File to write: .fits for the places of all fibres, or else state.csv (default: "
          "stdout)");
  command->add_flag("--allow-unknown", options->allow_unknown,
                    "Leave out units of unknown place (a comment names each), instead of refusing");
  OnChosen(line, command, options, RunState);
}

// ---- history

struct HistoryOptions {
  UnitChoice choice;
  std::uint32_t limit = 20;
  std::string since;
  std::string until;
  std::string state;
};

// A list with its columns in order: identity, event, time, result, cost.
struct HistoryTable {
  const char* name;
  std::vector<std::string> columns;
};
std::vector<HistoryTable> HistoryTables() {
  return {
      {"configurations",
       {"id", "state", "source", "began", "changed", "targeted", "arrived", "refused", "failed",
        "stopped", "unmeasured", "makespan_s", "makespan_predicted_s", "energy_J", "peak_power_W"}},
      {"alarms", {"id", "at", "severity", "name", "bus_id", "unit_id", "text"}},
      {"moves",
       {"configuration", "move", "end", "began", "ended", "theta_from_vectors", "theta_to_vectors",
        "theta_low_vectors", "theta_high_vectors", "theta_witness", "phi_from_vectors",
        "phi_to_vectors", "phi_low_vectors", "phi_high_vectors", "phi_witness", "unit_id",
        "serial"}},
      {"measured", {"configuration", "exposure", "status", "error_um", "at"}},
      {"unit", {"at", "enabled", "reason", "unit_id", "serial"}}};
}

std::string DescribeHistory(const Json& history, bool colour_on) {
  std::string text;
  for (const HistoryTable& table : HistoryTables()) {
    const Json& rows = ListIn(history, table.name);
    if (rows.empty()) continue;
    text +=
        fmt::format("{}{}\n{}", text.empty() ? "" : "\n\n",
                    Paint(colour_on, Colour::kBold, table.name), DescribeRows(rows, table.columns));
  }
  return text.empty() ? "nothing yet" : text;
}

ExitCode RunHistory(const Context& context, const HistoryOptions& options) {
  Json args{{"limit", options.limit}};
  if (!options.state.empty()) args["state"] = options.state;
  const WallTime now = WallTime::Now();
  const std::pair<const char*, const std::string&> times[] = {{"since_ns", options.since},
                                                              {"until_ns", options.until}};
  for (const auto& [key, text] : times) {
    if (text.empty()) continue;
    const auto at = InstantOf(text, now);
    if (!at) return Report(context, at.error());
    args[key] = at->ns;
  }
  if (!options.choice.empty()) {
    const auto units = ChosenUnits(context, options.choice);
    if (!units) return Report(context, units.error());
    const auto tell = [&](std::uint32_t id, Json* history) {
      Say(context, (units->size() > 1 ? fmt::format("unit {}\n", id) : std::string()) +
                       DescribeHistory(*history, context.colour_out));
      return true;
    };
    return AskForEach(context, *units, {.verb = "history", .args = args, .tell = tell});
  }
  const auto history = Ask(context, {.verb = "history", .args = args});
  if (!history) return Report(context, history.error());
  if (context.json) PrintJson(*history);
  Say(context, DescribeHistory(*history, context.colour_out));
  return ExitCode::kOk;
}

void AddHistory(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "history", "Show past configurations, or the moves of units",
                 "  focalfleet history\n  focalfleet history 4711,4720-4722 --limit 5");
  auto options = std::make_shared<HistoryOptions>();
  AddUnitNumbers(command, &options->choice, "Their unit_ids (default: the fleet's configurations)");
  command->add_option("--limit", options->limit, "Newest rows to show")->capture_default_str();
  command->add_option("--since", options->since, "Since then: 2h, or a time of UTC");
  command->add_option("--until", options->until, "Until then: 2h, or a time of UTC");
  command->add_option("--state", options->state,
                      "Configurations that are done, stopped or failed; moves of a unit that "
                      "arrived, stopped, ended by a fault, never_began, interrupted or homed");
  OnChosen(line, command, options, RunHistory);
}

}  // namespace

void AddStatusCommands(CommandLine* line) {
  AddStatus(line);
  AddUnit(line);
  AddState(line);
  AddHistory(line);
}

}  // namespace focalfleet::cli
