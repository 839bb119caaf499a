// stop [UNIT]: through the daemon, or with --direct past it.

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

constexpr std::chrono::milliseconds kLookEvery{50};

/// How many units may still move: all, or the one named. Errors: as Ask.
tl::expected<std::uint64_t, Failure> CountMoving(const Context& context,
                                                 const std::optional<std::uint32_t>& unit_id) {
  constexpr std::array kMoving{"moving", "homing", "settling"};
  const auto is_moving = [&](const std::string& phase) {
    return std::ranges::find(kMoving, phase) != kMoving.end();
  };
  if (unit_id) {
    const auto unit = Ask(context, {.verb = "unit", .args = {{"unit_id", *unit_id}}});
    if (!unit) return tl::unexpected(unit.error());
    return std::uint64_t{is_moving(TextIn(*unit, "phase")) ? 1u : 0u};
  }
  const auto status = Ask(context, {.verb = "status"});
  if (!status) return tl::unexpected(status.error());
  std::uint64_t moving = 0;
  for (const char* phase : kMoving) moving += CountIn(ObjectIn(*status, "phases"), phase);
  return moving;
}

/// What was asked for is that units stand; "sent" alone is not done.
ExitCode TellWhetherAllStand(const Context& context, const StopOptions& options) {
  const auto give_up =
      std::chrono::steady_clock::now() + std::chrono::duration<double>(options.within_s);
  for (;;) {
    const auto moving = CountMoving(context, options.unit_id);
    const bool over = std::chrono::steady_clock::now() >= give_up;
    // A stop is let in where all places are taken, a question is not.
    if (!moving && moving.error().error.code == ErrorCode::kFull && !over) {
      std::this_thread::sleep_for(kLookEvery);
      continue;
    }
    if (!moving)
      return Report(context, Failure{ExitCode::kBroken,
                                     {moving.error().error.code,
                                      "stop sent; whether units stand is not known: " +
                                          moving.error().error.text}});
    if (*moving > 0 && !over) {
      std::this_thread::sleep_for(kLookEvery);
      continue;
    }
    if (context.json) PrintJson({{"text", "stop sent"}, {"not_standing", *moving}});
    if (*moving == 0) {
      Say(context, options.unit_id ? "it stands" : "all units stand, or do not answer");
      return ExitCode::kOk;
    }
    Complain(
        fmt::format("focalfleet: {} did not confirm within {:g} s to stand: `focalfleet status`, "
                    "`focalfleet stop` "
                    "again, or `focalfleet stop --direct`\n",
                    Count(*moving, "unit", "units"), options.within_s));
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
  return TellWhetherAllStand(context, options);
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
