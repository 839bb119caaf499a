// The command stop [UNIT] stops units through the daemon, or with --direct without it.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <optional>
#include <thread>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/direct_stop.h"

namespace focalfleet::cli {
namespace {

struct StopOptions {
  std::optional<std::uint32_t> unit_id;
  bool direct = false;
  // Units answer a stop within some tens of milliseconds. The daemon repeats a lost frame for up to
  // 1.6 s (CoordinatorConfig::reply_wait).
  double within_s = 5;
  std::string config = kDefaultConfig;
};

Json JsonOf(const std::vector<DirectStopBus>& buses) {
  Json rows = Json::array();
  for (const DirectStopBus& bus : buses) {
    rows.push_back({{"bus", bus.name},
                    {"sent", bus.sent},
                    {"units_answered", bus.units_answered},
                    {"trouble", bus.trouble}});
  }
  return rows;
}

ExitCode RunDirectStop(const Context& context, const StopOptions& options) {
  DirectStopRequest request{.config = options.config};
  if (options.unit_id) request.unit = UnitId{*options.unit_id};
  const auto buses = DirectStop(request);
  if (!buses) return Report(context, buses.error());
  std::uint32_t sent = 0;
  std::uint32_t answered = 0;
  std::string troubles;
  for (const DirectStopBus& bus : *buses) {
    sent += bus.sent ? 1u : 0u;
    answered += bus.units_answered;
    if (!bus.sent) troubles += fmt::format("\n  {}: {}", bus.name, bus.trouble);
  }
  if (sent == 0) {
    return Report(context,
                  {ErrorCode::kUnavailable, fmt::format("no bus took the stop:{}", troubles)});
  }
  if (context.json) {
    PrintJson({{"buses", JsonOf(*buses)}, {"sent", sent}, {"units_answered", answered}});
  }
  Say(context, fmt::format("stop is on {} of {}; {} answered", sent,
                           Count(buses->size(), "bus", "buses"), Count(answered, "unit", "units")));
  if (troubles.empty() && answered > 0) return ExitCode::kOk;
  if (answered == 0) Complain("focalfleet: no unit answered: whether they stand is not known\n");
  if (!troubles.empty()) Complain(fmt::format("focalfleet: not stopped:{}\n", troubles));
  return ExitCode::kSomeUnserved;
}

constexpr std::chrono::milliseconds kConfirmEvery{50};

struct NotStanding {
  std::uint64_t moving = 0;     // by the daemon's state
  std::uint64_t not_known = 0;  // they do not answer, or not yet
};

/// Counts the units that do not stand: among all units, or the named one. A unit that has never
/// answered counts only where it is named. Otherwise a fleet with one broken unit could never be
/// reported as standing.
/// Errors: as Ask.
tl::expected<NotStanding, Failure> CountNotStanding(const Context& context,
                                                    const std::optional<std::uint32_t>& unit_id) {
  Json phases;
  if (unit_id) {
    const auto unit = Ask(context, {.verb = "unit", .args = {{"unit_id", *unit_id}}});
    if (!unit) return tl::unexpected(unit.error());
    phases[TextIn(*unit, "phase")] = 1u;
  } else {
    const auto status = Ask(context, {.verb = "status"});
    if (!status) return tl::unexpected(status.error());
    phases = ObjectIn(*status, "phases");
  }
  NotStanding units;
  for (const char* phase : {"moving", "homing", "settling"}) units.moving += CountIn(phases, phase);
  for (const char* phase : {"silent", "identifying"}) units.not_known += CountIn(phases, phase);
  if (unit_id) units.not_known += CountIn(phases, "absent");
  return units;
}

/// Waits until the units stand and reports the result: a stop that was sent is not yet a stop that
/// was done.
ExitCode ReportWhetherAllStand(const Context& context, const StopOptions& options) {
  const auto give_up =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(options.within_s);
  for (;;) {
    const auto units = CountNotStanding(context, options.unit_id);
    const bool over = std::chrono::steady_clock::now() >= give_up;
    // A daemon whose places are all taken accepts a stop, but not a question.
    if (!units && units.error().error.code == ErrorCode::kFull && !over) {
      std::this_thread::sleep_for(kConfirmEvery);
      continue;
    }
    if (!units)
      return Report(context, Failure{ExitCode::kBroken,
                                     {units.error().error.code,
                                      "stop sent; whether units stand is not known: " +
                                          units.error().error.text}});
    const bool all_stand = units->moving == 0 && units->not_known == 0;
    if (!all_stand && !over) {
      std::this_thread::sleep_for(kConfirmEvery);
      continue;
    }
    if (context.json)
      PrintJson({{"text", "stop sent"},
                 {"not_standing", units->moving},
                 {"not_known", units->not_known}});
    if (all_stand) {
      Say(context, options.unit_id ? "it stands" : "all units that have ever answered stand");
      return ExitCode::kOk;
    }
    std::string trouble;
    if (units->moving > 0)
      trouble += fmt::format("{} did not confirm within {:g} s to stand",
                             Count(units->moving, "unit", "units"), options.within_s);
    if (units->not_known > 0)
      trouble +=
          fmt::format("{}{} not answer, so whether {} not known", trouble.empty() ? "" : "; ",
                      Count(units->not_known, "unit does", "units do"),
                      units->not_known == 1 ? "it stands is" : "they stand is");
    Complain(
        fmt::format("focalfleet: {}: `focalfleet status`, `focalfleet stop` again, or "
                    "`focalfleet stop --direct`\n",
                    trouble));
    return ExitCode::kSomeUnserved;
  }
}

ExitCode RunStop(const Context& context, const StopOptions& options) {
  if (options.direct) return RunDirectStop(context, options);
  Json args = Json::object();
  if (options.unit_id) args["unit_id"] = *options.unit_id;
  const auto answer = Ask(context, {.verb = "stop", .args = args});
  if (!answer) {
    Failure failure = answer.error();
    if (failure.exit != ExitCode::kRefused) {
      failure.error.text += "; `focalfleet stop --direct` stops the units without the daemon";
    }
    return Report(context, failure);
  }
  Say(context, options.unit_id ? fmt::format("unit {}: stop sent", *options.unit_id)
                               : "stop sent to all units");
  return ReportWhetherAllStand(context, options);
}

}  // namespace

void AddStopCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "stop", "Stop all units, or one, at their next vector",
                 "  focalfleet stop\n  focalfleet stop 4711\n"
                 "  focalfleet stop --direct --config /etc/focalfleet/focalfleet.toml");
  auto options = std::make_shared<StopOptions>();
  command->add_option("UNIT", options->unit_id, "Its unit_id (default: all)");
  command->add_option("--within-s", options->within_s, "How long to wait until they stand")
      ->check(NumberBetween(0, 600))
      ->capture_default_str();
  CLI::Option* direct = command->add_flag(
      "--direct", options->direct, "Past the daemon: put the stop frame on the buses from here");
  AddFile(command, "--config", &options->config,
          "The daemon's configuration, which names the buses")
      ->needs(direct)
      ->capture_default_str();
  OnChosen(line, command, options, RunStop);
}

}  // namespace focalfleet::cli
