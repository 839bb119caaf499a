// stop [UNIT]: through the daemon, or with --direct past it.

#include <fmt/format.h>

#include <optional>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"
#include "daemon/cli/direct_stop.h"

namespace focalfleet::cli {
namespace {

struct StopOptions {
  std::optional<std::uint32_t> unit_id;
  bool direct = false;
  std::string config = "/etc/focalfleet/focalfleet.toml";
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
  if (troubles.empty()) return ExitCode::kOk;
  Complain(fmt::format("focalfleet: not stopped:{}\n", troubles));
  return ExitCode::kSomeUnserved;
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
  if (context.json) PrintJson(*answer);
  Say(context, options.unit_id ? fmt::format("unit {}: stop sent", *options.unit_id)
                               : "stop sent to all units");
  return ExitCode::kOk;
}

}  // namespace

void AddStopCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "stop", "Stop all units, or one, at their next vector",
                 "  focalfleet stop\n  focalfleet stop 4711\n"
                 "  focalfleet stop --direct --config /etc/focalfleet/focalfleet.toml");
  auto options = std::make_shared<StopOptions>();
  command->add_option("UNIT", options->unit_id, "Its unit_id (default: all)");
  CLI::Option* direct = command->add_flag(
      "--direct", options->direct, "Past the daemon: put the stop frame on the buses from here");
  AddFile(command, "--config", &options->config,
          "The daemon's configuration, which names the buses")
      ->needs(direct)
      ->capture_default_str();
  OnChosen(line, command, options, RunStop);
}

}  // namespace focalfleet::cli
