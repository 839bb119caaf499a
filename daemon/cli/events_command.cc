// The command events shows what happened to the fleet, and with -f what happens.

#include <fmt/format.h>

#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"
#include "daemon/cli/time_text.h"
#include "daemon/control/id_ranges.h"

namespace focalfleet::cli {
namespace {

constexpr std::chrono::seconds kFollowEvery{1};

struct EventsOptions {
  std::string since;
  std::string until;
  std::vector<std::string> units;
  std::string severity;
  bool follow = false;
  std::uint32_t limit = 100;
};

Result<Json> ArgumentsOf(const EventsOptions& options) {
  Json args{{"limit", options.limit}};
  const WallTime now = WallTime::Now();
  const std::pair<const char*, const std::string&> times[] = {{"since_ns", options.since},
                                                              {"until_ns", options.until}};
  for (const auto& [key, text] : times) {
    if (text.empty()) continue;
    FOCALFLEET_TRY_ASSIGN(const WallTime at, InstantOf(text, now));
    args[key] = at.ns;
  }
  if (!options.severity.empty()) args["severity"] = options.severity;
  if (options.units.empty()) return args;
  std::vector<std::uint32_t> ids;
  for (const std::string& text : options.units) {
    FOCALFLEET_TRY_ASSIGN(const auto numbers, ParseRanges(text));
    ids.insert(ids.end(), numbers.begin(), numbers.end());
  }
  args["unit_ids"] = ids;
  return args;
}

std::string DescribeEvent(const Json& event, bool colour_on) {
  const std::string severity = TextIn(event, "severity");
  const Colour colour = severity == "error"     ? Colour::kRed
                        : severity == "warning" ? Colour::kYellow
                                                : Colour::kPlain;
  const std::string name = TextIn(event, "name");
  return fmt::format("{}  {:7}  {}{}", TextIn(event, "at"), Paint(colour_on, colour, severity),
                     name.empty() ? "" : name + ": ", TextIn(event, "text"));
}

void Show(const Context& context, const Json& events) {
  for (const Json& event : events) Say(context, DescribeEvent(event, context.colour_out));
}

/// Shows events as they come, until the daemon does not answer or stdout takes no more. With --json
/// each event is an object of its own. Each page goes on after the last one by the numbers of the
/// store, so that none is left out however many come.
ExitCode Follow(const Context& context, Json args) {
  for (;;) {
    const auto answer = Ask(context, {.verb = "events", .args = args});
    if (!answer) return Report(context, answer.error());
    if (!answer->contains("next"))
      return Report(context, {ErrorCode::kUnavailable,
                              "the daemon is of another version, whose events cannot be followed"});
    for (const Json& event : ListIn(*answer, "events"))
      if (context.json) PrintJson(event);
    Show(context, ListIn(*answer, "events"));
    if (OutputError() != 0) return ExitCode::kOk;  // Main reports it
    args["after"] = (*answer)["next"];
    for (const char* of_the_first : {"since_ns", "limit"}) args.erase(of_the_first);
    if (!answer->value("more", false)) std::this_thread::sleep_for(kFollowEvery);
  }
}

ExitCode RunEvents(const Context& context, const EventsOptions& options) {
  const auto args = ArgumentsOf(options);
  if (!args) return Report(context, args.error());
  if (options.follow) return Follow(context, *args);
  const auto answer = Ask(context, {.verb = "events", .args = *args});
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  Show(context, ListIn(*answer, "events"));
  if (ListIn(*answer, "events").empty()) Say(context, "nothing happened");
  return ExitCode::kOk;
}

}  // namespace

void AddEventsCommand(CommandLine* line) {
  CLI::App* command =
      AddCommand(&line->app, "events", "Show what happened: alarms, configurations, units",
                 "  focalfleet events --since 2h\n"
                 "  focalfleet events --since 2026-11-26T20:00Z --severity warning\n"
                 "  focalfleet events --unit 7,20-25 -f");
  auto options = std::make_shared<EventsOptions>();
  command->add_option("--since", options->since, "Since then: 2h, or a time of UTC");
  CLI::Option* until =
      command->add_option("--until", options->until, "Until then: 2h, or a time of UTC");
  command->add_option("--unit", options->units, "Of these units alone: 7,20-25")
      ->allow_extra_args(false);
  OneOf(command->add_option("--severity", options->severity, "At least as severe"),
        {"info", "warning", "error"});
  command->add_flag("-f,--follow", options->follow, "Go on and show events as they come")
      ->excludes(until);
  command->add_option("--limit", options->limit, "The newest of them, at most 1000")
      ->capture_default_str();
  OnChosen(line, command, options, RunEvents);
}

}  // namespace focalfleet::cli
