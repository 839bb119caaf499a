// The command watch shows the fleet as DDS reports it. A terminal gets a picture that is redrawn;
// with --json each change gives one JSON object.

#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <map>
#include <tuple>

#include "daemon/cli/command_line.h"
#include "daemon/cli/progress_bar.h"
#include "daemon/cli/table.h"
#include "daemon/control/printable.h"
#include "daemon/dds/status_reader.h"

namespace focalfleet::cli {
namespace {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

struct WatchOptions {
  std::uint32_t domain = 0;
  std::optional<std::uint32_t> sector;  // of a plane
  bool once = false;
  double wait_s = 5;
};

/// All of one daemon: of its own, of a sector, or of the coordinator of a plane.
struct Daemon {
  std::optional<FleetStatusValue> fleet;
  std::optional<ConfigurationProgressValue> configuration;
  std::optional<AuditHeadValue> audit_head;
  steady_clock::time_point heard = steady_clock::now();
  bool silent = false;
};

// Picture holds all values so far: DDS reports changes, but a picture needs the whole.
struct Picture {
  /// The key is the sector; none: a daemon of its own, or the coordinator.
  std::map<std::optional<std::uint32_t>, Daemon> daemons;
  std::map<BusId, BusStatusValue> buses;
  std::map<UnitId, UnitStatusValue> units;
  /// The newest kAlarmsShown, by their time and number.
  std::map<std::tuple<WallTime, std::optional<std::uint32_t>, std::uint64_t>, AlarmValue> alarms;
  steady_clock::time_point grew = steady_clock::now();  // a further daemon was heard

  [[nodiscard]] bool IsOfPlane() const {
    return !daemons.empty() && daemons.rbegin()->first.has_value();
  }
  /// The daemon that has the whole: the coordinator, or one of its own. Null: none is heard.
  [[nodiscard]] const Daemon* whole() const {
    const auto at = daemons.find(std::nullopt);
    return at == daemons.end() ? nullptr : &at->second;
  }
};
/// Without a coordinator nobody says how many sectors there are.
constexpr milliseconds kSettled(2000);
constexpr std::size_t kAlarmsShown = 8;
constexpr std::size_t kUnitsShown = 12;

// Texts from DDS may come from any program on the network, so they are made safe for a terminal.
void Absorb(const StatusUpdate& update, Picture* picture) {
  for (const FleetStatusValue& fleet : update.fleets) {
    const auto [at, is_new] = picture->daemons.try_emplace(fleet.sector);
    Daemon& daemon = at->second;
    if (is_new) picture->grew = steady_clock::now();
    daemon.fleet = fleet;
    daemon.fleet->version = Printable(fleet.version);
    daemon.heard = steady_clock::now();
  }
  for (const AuditHeadValue& head : update.audit_heads)
    picture->daemons[head.sector].audit_head = head;
  for (const ConfigurationProgressValue& value : update.configurations) {
    auto& kept = picture->daemons[value.sector].configuration = value;
    kept->view.source = Printable(value.view.source);
  }
  for (const BusStatusValue& bus : update.buses) picture->buses[bus.bus] = bus;
  for (const UnitStatusValue& unit : update.units) picture->units[unit.unit] = unit;
  for (const AlarmValue& alarm : update.alarms) {
    AlarmValue& kept = picture->alarms[{alarm.at, alarm.sector, alarm.row.id}] = alarm;
    kept.row.text = Printable(alarm.row.text);
  }
  while (picture->alarms.size() > kAlarmsShown) picture->alarms.erase(picture->alarms.begin());
}

/// True: a daemon has fallen silent, or is heard again.
bool LookForSilence(Picture* picture) {
  bool changed = false;
  for (auto& [sector, daemon] : picture->daemons) {
    const bool silent = steady_clock::now() - daemon.heard > kSilentAfter;
    changed |= silent != daemon.silent;
    daemon.silent = silent;
  }
  return changed;
}

bool IsHeard(const Picture& picture) {
  for (const auto& [sector, daemon] : picture.daemons)
    if (daemon.fleet) return true;
  return false;
}

bool WholeFleetIsThere(const Picture& picture) {
  std::size_t units = 0;
  for (const auto& [sector, daemon] : picture.daemons)
    if (sector && daemon.fleet) units += daemon.fleet->units;
  const Daemon* const whole = picture.whole();
  if (whole != nullptr && whole->fleet)
    units = whole->fleet->units;
  else if (steady_clock::now() - picture.grew < kSettled)
    return false;
  return picture.units.size() >= units;
}

// ---- JSON

Json Counts(const FleetStatusValue& fleet) {
  Json phases = Json::object();
  for (std::uint8_t i = 0; i < kUnitPhaseCount; ++i) {
    if (fleet.units_by_phase[i] != 0) {
      phases[Name(static_cast<UnitPhase>(i))] = fleet.units_by_phase[i];
    }
  }
  Json witnesses = Json::object();
  for (std::size_t i = 0; i < kWitnessCount; ++i) {
    witnesses[Name(static_cast<Witness>(i))] = fleet.units_by_witness[i];
  }
  return {{"time", ToIso8601(fleet.at)},
          {"version", fleet.version},
          {"units", fleet.units},
          {"enabled", fleet.enabled},
          {"phases", phases},
          {"positions", witnesses},
          {"configuration", fleet.configuration},
          {"bus_load_max", fleet.bus_load_max},
          {"busy", fleet.busy},
          {"store_failing", fleet.store_failing}};
}

Json JsonOf(const ConfigurationProgressValue& value) {
  const ConfigurationView& view = value.view;
  return {
      {"time", ToIso8601(value.at)},
      {"id", view.id},
      {"source", view.source},
      {"state", Name(view.state)},
      {"round", view.round},
      {"targeted", view.counts.targeted},
      {"arrived", view.counts.arrived},
      {"refused", view.counts.refused},
      {"failed", view.counts.failed},
      {"stopped", view.counts.stopped},
      {"unmeasured", view.counts.unmeasured},
      {"makespan_predicted_s", view.makespan_predicted_s},
      {"makespan_s", view.makespan_s},
      {"energy_J", view.energy_J},
      {"peak_power_W", view.peak_power_W},
      {"frames", view.frames},
      {"starts", view.starts.begun},
      {"starts_known", view.starts.reported},
      {"start_skew_s", view.starts.reported > 0 ? Json(view.starts.skew_s) : Json(nullptr)},
      {"start_skew_bound_s", view.starts.reported > 0 ? Json(view.starts.bound_s) : Json(nullptr)},
      {"upload_predicted_s", view.upload.predicted_s},
      {"upload_s", view.upload.measured_s}};
}

Json JsonOf(const UnitStatusValue& unit) {
  Json row{
      {"time", ToIso8601(unit.at)}, {"unit_id", unit.unit.value},    {"serial", unit.serial.value},
      {"bus_id", unit.bus.value},   {"node_id", unit.node.value},    {"phase", Name(unit.phase)},
      {"fault", Name(unit.fault)},  {"outcome", Name(unit.outcome)}, {"enabled", unit.enabled},
      {"x_mm", unit.x_fp_mm},       {"y_mm", unit.y_fp_mm}};
  for (const Axis axis : kAxes) {
    const std::string name = Name(axis);
    row[name + "_witness"] = Name(unit.witness[Index(axis)]);
    row[name + "_low_deg"] = unit.low_deg[Index(axis)];
    row[name + "_high_deg"] = unit.high_deg[Index(axis)];
    row[name + "_target_deg"] = unit.target_deg[Index(axis)];
  }
  return row;
}

Json JsonOf(const BusStatusValue& bus) {
  return {{"time", ToIso8601(bus.at)},
          {"bus_id", bus.bus.value},
          {"link", Name(bus.view.link)},
          {"load", bus.view.load},
          {"load_max", bus.view.load_max},
          {"frames_sent", bus.view.frames_sent},
          {"frames_received", bus.view.frames_received},
          {"malformed", bus.view.malformed},
          {"retries", bus.view.retries}};
}

Json JsonOf(const AlarmValue& alarm) {
  Json row{{"time", ToIso8601(alarm.at)},
           {"id", alarm.row.id},
           {"severity", Name(alarm.row.severity)},
           {"name", Name(alarm.row.name)},
           {"text", alarm.row.text}};
  if (alarm.sector) row["sector"] = *alarm.sector;
  if (alarm.row.unit) row["unit_id"] = alarm.row.unit->value;
  if (alarm.row.bus) row["bus_id"] = alarm.row.bus->value;
  return row;
}

template <class Values>
Json Rows(const Values& values) {
  Json rows = Json::array();
  for (const auto& value : values) rows.push_back(JsonOf(value));
  return rows;
}

/// A sector of a plane, as far as there is news of it.
Json JsonOfSector(std::uint32_t sector, const Daemon& daemon, const Daemon& news) {
  Json object{
      {"sector", sector},
      {"silent", daemon.silent},
      {"heard_s_ago", std::chrono::duration<double>(steady_clock::now() - daemon.heard).count()}};
  if (news.fleet) object["fleet"] = Counts(*news.fleet);
  if (news.configuration) object["configuration"] = JsonOf(*news.configuration);
  if (news.audit_head) object["audit_head"] = Printable(news.audit_head->head);
  return object;
}

// The update as one object; members without news are omitted.
Json JsonOf(const StatusUpdate& update, const Picture& picture) {
  Json object = Json::object();
  std::map<std::optional<std::uint32_t>, Daemon> news;
  for (const FleetStatusValue& fleet : update.fleets) news[fleet.sector].fleet = fleet;
  for (const auto& value : update.configurations) news[value.sector].configuration = value;
  for (const AuditHeadValue& head : update.audit_heads) news[head.sector].audit_head = head;
  for (const auto& [sector, daemon] : picture.daemons)
    if (daemon.silent) news.try_emplace(sector);
  Json sectors = Json::array();
  for (const auto& [sector, daemon] : news) {
    if (sector) {
      sectors.push_back(JsonOfSector(*sector, picture.daemons.at(sector), daemon));
      continue;
    }
    if (daemon.fleet) object["fleet"] = Counts(*daemon.fleet);
    if (daemon.configuration) object["configuration"] = JsonOf(*daemon.configuration);
    if (daemon.audit_head) object["audit_head"] = Printable(daemon.audit_head->head);
  }
  if (!sectors.empty()) object["sectors"] = std::move(sectors);
  if (!update.units.empty()) object["units"] = Rows(update.units);
  if (!update.buses.empty()) object["buses"] = Rows(update.buses);
  if (!update.alarms.empty()) object["alarms"] = Rows(update.alarms);
  return object;
}

StatusUpdate Whole(const Picture& picture) {
  StatusUpdate whole;
  for (const auto& [sector, daemon] : picture.daemons) {
    if (daemon.fleet) whole.fleets.push_back(*daemon.fleet);
    if (daemon.configuration) whole.configurations.push_back(*daemon.configuration);
    if (daemon.audit_head) whole.audit_heads.push_back(*daemon.audit_head);
  }
  for (const auto& [id, unit] : picture.units) whole.units.push_back(unit);
  for (const auto& [id, bus] : picture.buses) whole.buses.push_back(bus);
  for (const auto& [id, alarm] : picture.alarms) whole.alarms.push_back(alarm);
  return whole;
}

// ---- text for human readers

std::string DescribeFleet(const FleetStatusValue& fleet, bool colour_on) {
  std::string phases;
  for (std::uint8_t i = 0; i < kUnitPhaseCount; ++i) {
    if (fleet.units_by_phase[i] == 0) continue;
    phases += fmt::format("{}{} {}", phases.empty() ? "" : ", ", fleet.units_by_phase[i],
                          Name(static_cast<UnitPhase>(i)));
  }
  std::string witnesses;
  for (std::size_t i = kWitnessCount; i-- > 0;) {
    if (fleet.units_by_witness[i] == 0) continue;
    witnesses += fmt::format("{}{} {}", witnesses.empty() ? "" : ", ", fleet.units_by_witness[i],
                             Name(static_cast<Witness>(i)));
  }
  return fmt::format("{}  focalfleetd {}  {}{}\nunits      {}, {} enabled: {}\npositions  {}\n",
                     ToIso8601(fleet.at), fleet.version,
                     fleet.busy ? Paint(colour_on, Colour::kYellow, "busy")
                                : Paint(colour_on, Colour::kGreen, "idle"),
                     fleet.store_failing ? Paint(colour_on, Colour::kRed, "  STORE FAILING") : "",
                     fleet.units, fleet.enabled, phases, witnesses);
}

std::string DescribeProgress(const ConfigurationProgressValue& value) {
  const ConfigurationView& view = value.view;
  const double fraction =
      view.counts.targeted == 0 ? 0 : double{1.0 * view.counts.arrived} / view.counts.targeted;
  return fmt::format(
      "configuration {} ({}): {}, round {}\n{}\n", view.id, view.source, Name(view.state),
      view.round,
      DrawBar(fraction,
              fmt::format("{} of {} arrived, {} refused, {} failed, {} stopped, {} "
                          "unmeasured",
                          view.counts.arrived, view.counts.targeted, view.counts.refused,
                          view.counts.failed, view.counts.stopped, view.counts.unmeasured),
              100));
}

std::string DescribeBuses(const Picture& picture, bool colour_on) {
  std::size_t up = 0;
  double load = 0;
  std::string troubled;
  for (const auto& [id, bus] : picture.buses) {
    load = std::max(load, bus.view.load);
    if (bus.view.link == LinkState::kUp) {
      ++up;
    } else {
      troubled += fmt::format("  bus {}: {}\n", id.value,
                              Paint(colour_on, Colour::kRed, Name(bus.view.link)));
    }
  }
  return fmt::format("buses      {} of {} up, load now up to {:.0f} %\n{}", up,
                     picture.buses.size(), 100 * load, troubled);
}

// Only units that need attention are listed: not at rest in good order, or with a fault.
std::string DescribeUnits(const Picture& picture) {
  std::vector<std::vector<std::string>> rows{{"unit", "phase", "fault", "theta", "phi", "outcome"}};
  std::size_t more = 0;
  for (const auto& [id, unit] : picture.units) {
    const bool fine = (unit.phase == UnitPhase::kReady || unit.phase == UnitPhase::kMoving) &&
                      unit.fault == FaultCode::kNone && unit.witness[0] >= Witness::kPredicted &&
                      unit.witness[1] >= Witness::kPredicted;
    if (fine || !unit.enabled) continue;
    if (rows.size() > kUnitsShown) {
      ++more;
      continue;
    }
    rows.push_back({fmt::format("{}", id.value), Name(unit.phase), Name(unit.fault),
                    Name(unit.witness[0]), Name(unit.witness[1]), Name(unit.outcome)});
  }
  if (rows.size() == 1) return "";
  return AlignColumns(rows) + (more == 0 ? "\n" : fmt::format("\nand {} more\n", more));
}

std::string DescribeAlarms(const Picture& picture, bool colour_on) {
  std::string text;
  for (const auto& [id, alarm] : picture.alarms) {
    const Colour colour = alarm.row.severity == Severity::kError ? Colour::kRed : Colour::kYellow;
    text += fmt::format("{}  {}  {}{}: {}\n", ToIso8601(alarm.at),
                        Paint(colour_on, colour, Name(alarm.row.severity)),
                        alarm.sector ? fmt::format("sector {}: ", *alarm.sector) : "",
                        Name(alarm.row.name), alarm.row.text);
  }
  return text;
}

std::string DescribeSector(std::uint32_t sector, const Daemon& daemon, bool colour_on) {
  std::string text = fmt::format("sector {}   ", sector);
  if (daemon.silent) {
    const auto age = std::chrono::duration<double>(steady_clock::now() - daemon.heard);
    return text +
           Paint(colour_on, Colour::kRed,
                 fmt::format("silent for {:.0f} s, its units are as last heard", age.count())) +
           "\n";
  }
  if (!daemon.fleet) return text + "nothing heard of its fleet yet\n";
  const FleetStatusValue& fleet = *daemon.fleet;
  text += fmt::format("{}, {} units, {} enabled", fleet.busy ? "busy" : "idle", fleet.units,
                      fleet.enabled);
  if (fleet.store_failing) text += Paint(colour_on, Colour::kRed, ", STORE FAILING");
  if (daemon.configuration) {
    const OutcomeCounts& counts = daemon.configuration->view.counts;
    text += fmt::format(", {}, {} of {} arrived", Name(daemon.configuration->view.state),
                        counts.arrived, counts.targeted);
  }
  return text + "\n";
}

void Draw(const Context& context, const Picture& picture, bool over) {
  std::string text;
  const Daemon* const whole = picture.whole();
  if (whole != nullptr && whole->fleet) text += DescribeFleet(*whole->fleet, context.colour_out);
  if (picture.IsOfPlane() && (whole == nullptr || whole->silent))
    text += Paint(context.colour_out, Colour::kRed, "the plane's coordinator is not heard") + "\n";
  for (const auto& [sector, daemon] : picture.daemons)
    if (sector) text += DescribeSector(*sector, daemon, context.colour_out);
  text += DescribeBuses(picture, context.colour_out);
  if (whole != nullptr && whole->configuration) text += DescribeProgress(*whole->configuration);
  text += DescribeUnits(picture) + DescribeAlarms(picture, context.colour_out);
  if (over)
    PrintScreen(text);
  else
    PrintText(text);
}

// ---- the loop

ExitCode ReportNoPublisher(const Context& context, const WatchOptions& options, bool seen) {
  return Report(
      context,
      {ErrorCode::kUnavailable,
       seen ? std::string("the daemon is gone from DDS")
            : fmt::format(
                  "no daemon publishes on DDS domain {} after {:.1f} s; is focalfleetd "
                  "running with [dds] enabled, is its dds.domain this one (--domain), and is "
                  "$CYCLONEDDS_URI here what its dds.config is?",
                  options.domain, options.wait_s)},
      seen ? ExitCode::kBroken : ExitCode::kNoDaemon);
}

volatile std::sig_atomic_t interrupted = 0;

ExitCode Loop(const Context& context, const WatchOptions& options, StatusReader* reader) {
  const auto begun = steady_clock::now();
  const auto patience = std::chrono::duration<double>(options.wait_s);
  Picture picture;
  StatusUpdate update;
  while (interrupted == 0) {
    const auto came = reader->Wait(milliseconds(200));
    if (!came) return Report(context, came.error(), ExitCode::kBroken);
    if (const auto taken = reader->Take(&update); !taken) {
      return Report(context, taken.error(), ExitCode::kBroken);
    }
    Absorb(update, &picture);
    const bool silence = LookForSilence(&picture);
    const bool late = steady_clock::now() - begun > patience;
    const bool heard = IsHeard(picture);
    if (late && !heard) return ReportNoPublisher(context, options, reader->writer_seen());
    if (heard && !reader->writer_alive()) return ReportNoPublisher(context, options, true);
    if (options.once) {
      // Late values are omitted: waiting for them might never end.
      if (!heard || (!late && !WholeFleetIsThere(picture))) continue;
      if (context.json) {
        PrintJson(JsonOf(Whole(picture), picture));
      } else {
        Draw(context, picture, false);
      }
      return ExitCode::kOk;
    }
    if (update.count() == 0 && !silence) continue;
    if (context.json) {
      PrintJson(JsonOf(update, picture));
    } else {
      Draw(context, picture, context.terminal_out);
    }
    if (OutputError() != 0) break;
  }
  return ExitCode::kOk;
}

ExitCode RunWatch(const Context& context, const WatchOptions& options) {
  std::signal(SIGINT, [](int) { interrupted = 1; });
  const char* config = std::getenv("CYCLONEDDS_URI");
  auto reader = StatusReader::Create(
      {.dds = {.domain = options.domain,
               .config_xml = config != nullptr ? config : "",
               .partition = options.sector ? SectorPartition(*options.sector) : ""},
       .partitions = options.sector ? std::vector<std::string>() : AllPartitions()});
  if (!reader) return Report(context, reader.error(), ExitCode::kNoDaemon);
  return Loop(context, options, reader->get());
}

}  // namespace

void AddWatchCommand(CommandLine* line) {
  CLI::App* command = AddCommand(&line->app, "watch", "Watch the fleet live, through DDS",
                                 "  focalfleet watch\n  focalfleet watch --once\n"
                                 "  focalfleet watch --json | jq -c .fleet");
  auto options = std::make_shared<WatchOptions>();
  command->add_option("--sector", options->sector,
                      "Of a plane: this sector alone, by its number from 0");
  command->add_option("--domain", options->domain, "DDS domain")
      ->check(CLI::Range(0, 230))
      ->capture_default_str();
  command->add_flag("--once", options->once, "Show the whole fleet once and end");
  command
      ->add_option("--wait", options->wait_s,
                   "Seconds to wait for a daemon, and with --once for all units")
      ->check(NumberBetween(0, 86'400))
      ->capture_default_str();
  OnChosen(line, command, options, RunWatch);
}

}  // namespace focalfleet::cli
