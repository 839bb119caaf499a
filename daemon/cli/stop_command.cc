// stop [UNIT]: through the daemon, or with --direct past it.

#include <fmt/format.h>

#include <optional>

#include "daemon/cli/client.h"
#include "daemon/cli/command_line.h"

namespace focalfleet::cli {
namespace {

struct StopOptions {
  std::optional<std::uint32_t> unit_id;
  bool direct = false;
  std::string config = "/etc/focalfleet/focalfleet.toml";
};

ExitCode RunStop(const Context& context, const StopOptions& options) {
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
  OnChosen(line, command, options, RunStop);
}

}  // namespace focalfleet::cli
