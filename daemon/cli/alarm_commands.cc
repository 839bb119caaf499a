// The command alarms [ack|mute|unmute] shows alarms that are open, and takes what operators do
// about them.

#include <fmt/format.h>
#include <pwd.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "daemon/cli/client.h"
#include "daemon/cli/operator_commands.h"
#include "daemon/cli/table.h"
#include "daemon/cli/time_text.h"
#include "daemon/control/id_ranges.h"

namespace focalfleet::cli {
namespace {

// ---- list

struct ListOptions {
  bool all = false;
  std::string since;
  std::string severity;
};

/// The login name of `uid 1000`, where this machine knows it.
std::string UserIn(const Json& object, const char* key) {
  const std::string text = TextIn(object, key);
  uid_t uid = 0;
  if (!text.starts_with("uid ") ||
      std::from_chars(text.data() + 4, text.data() + text.size(), uid).ec != std::errc())
    return text;
  const passwd* const user = ::getpwuid(uid);
  return user == nullptr ? text : user->pw_name;
}

/// Alarms of one name that are shown as one line.
struct Line {
  const Json* newest = nullptr;
  std::vector<std::uint32_t> units;
  std::uint64_t count = 0;
  std::size_t alarms = 0;
};

std::string StateOf(const Json& alarm) {
  const std::string state = TextIn(alarm, "state");
  if (state == "acknowledged" || (state == "over" && !TextIn(alarm, "acknowledged").empty()))
    return fmt::format("{} (acknowledged by {})", state, UserIn(alarm, "acknowledged_by"));
  return alarm.value("muted", false) && state == "open" ? "muted" : state;
}

/// Units with alarms of one name, severity and state become one line.
std::vector<Line> LinesOf(const Json& alarms) {
  std::map<std::pair<std::string, std::string>, std::size_t> line_of;
  std::vector<Line> lines;
  for (const Json& alarm : alarms) {
    const bool of_unit = alarm.contains("unit_id") && alarm["unit_id"].is_number_unsigned();
    std::size_t at = lines.size();
    if (of_unit)
      at = line_of.emplace(std::pair(TextIn(alarm, "name"), StateOf(alarm)), at).first->second;
    if (at == lines.size()) lines.emplace_back();
    Line& line = lines[at];
    line.newest = &alarm;
    line.count += CountIn(alarm, "count");
    ++line.alarms;
    if (of_unit) line.units.push_back(static_cast<std::uint32_t>(CountIn(alarm, "unit_id")));
  }
  return lines;
}

Colour ColourOf(const std::string& severity) {
  return severity == "error" ? Colour::kRed : Colour::kYellow;
}

std::string DescribeLine(const Line& line, bool colour_on) {
  const Json& alarm = *line.newest;
  const std::string severity = TextIn(alarm, "severity");
  const std::string times = line.count > 1 ? fmt::format(", {} times", line.count) : "";
  std::string text = fmt::format(
      "{}  {} {}  {}{}\n", TextIn(alarm, "last"), Paint(colour_on, ColourOf(severity), severity),
      Paint(colour_on, Colour::kBold, TextIn(alarm, "name")), StateOf(alarm), times);
  text += line.alarms > 1
              ? fmt::format("  {} units ({}), the newest: {}\n", line.alarms,
                            DescribeRanges(line.units, 10), TextIn(alarm, "text"))
              : fmt::format("  {} (alarm {})\n", TextIn(alarm, "text"), CountIn(alarm, "id"));
  return text + fmt::format("  {}\n", TextIn(alarm, "runbook"));
}

std::string DescribeMute(const Json& mute) {
  const std::uint64_t since = CountIn(mute, "open_since");
  return fmt::format("muted  {} until {} by {}: {} ({} open{})\n", TextIn(mute, "name"),
                     TextIn(mute, "until"), UserIn(mute, "by"), TextIn(mute, "reason"),
                     CountIn(mute, "open"), since > 0 ? fmt::format(", {} since", since) : "");
}

std::string DescribeAlarms(const Json& answer, bool all, bool colour_on) {
  std::string text;
  for (const Line& line : LinesOf(ListIn(answer, "alarms")))
    if (all || !line.newest->value("muted", false)) text += DescribeLine(line, colour_on);
  if (text.empty()) text = all ? "no alarms\n" : "no open alarms\n";
  for (const Json& mute : ListIn(answer, "mutes")) text += DescribeMute(mute);
  text.pop_back();
  return text;
}

ExitCode RunList(const Context& context, const ListOptions& options) {
  Json args{{"all", options.all}};
  if (!options.severity.empty()) args["severity"] = options.severity;
  if (!options.since.empty()) {
    const auto since = InstantOf(options.since, WallTime::Now());
    if (!since) return Report(context, since.error());
    args["since_ns"] = since->ns;
  }
  const auto answer = Ask(context, {.verb = "alarms", .args = args});
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  Say(context, DescribeAlarms(*answer, options.all, context.colour_out));
  return ExitCode::kOk;
}

// ---- ack, mute, unmute

struct ChangeOptions {
  std::vector<std::string> alarms;
  std::string lasts;
  std::string reason;
};

ExitCode Tell(const Context& context, const tl::expected<Json, Failure>& answer) {
  if (!answer) return Report(context, answer.error());
  if (context.json) PrintJson(*answer);
  Say(context, TextIn(*answer, "text"));
  return ExitCode::kOk;
}

ExitCode RunAck(const Context& context, const ChangeOptions& options) {
  Json ids = Json::array();
  Json names = Json::array();
  for (const std::string& alarm : options.alarms) {
    std::uint64_t id = 0;
    const auto [at, error] = std::from_chars(alarm.data(), alarm.data() + alarm.size(), id);
    if (error == std::errc() && at == alarm.data() + alarm.size())
      ids.push_back(id);
    else
      names.push_back(alarm);
  }
  Json args = Json::object();
  if (!ids.empty()) args["ids"] = ids;
  if (!names.empty()) args["names"] = names;
  return Tell(context, Ask(context, {.verb = "alarms_ack", .args = args}));
}

ExitCode RunMute(const Context& context, const ChangeOptions& options) {
  const auto lasts_s = SecondsOf(options.lasts);
  if (!lasts_s) return Report(context, lasts_s.error());
  return Tell(context, Ask(context, {.verb = "alarms_mute",
                                     .args = {{"name", options.alarms.front()},
                                              {"for_s", *lasts_s},
                                              {"reason", options.reason}}}));
}

ExitCode RunUnmute(const Context& context, const ChangeOptions& options) {
  return Tell(context,
              Ask(context, {.verb = "alarms_unmute", .args = {{"name", options.alarms.front()}}}));
}

CLI::Option* AddName(CLI::App* command, std::vector<std::string>* names) {
  return command->add_option("NAME", *names, "The alarm's name, as docs/runbook.md has it")
      ->required()
      ->expected(1);
}

}  // namespace

void AddAlarmCommands(CommandLine* line) {
  CLI::App* alarms = AddCommand(
      &line->app, "alarms", "Show open alarms; acknowledge or mute them",
      "  focalfleet alarms\n  focalfleet alarms --all --since 12h\n"
      "  focalfleet alarms ack 12\n  focalfleet alarms ack UnitNeverBegan\n"
      "  focalfleet alarms mute UnitSilent --for 2h --reason 'rail 3 is off for repair'");
  alarms->require_subcommand(0, 1);
  auto listed = std::make_shared<ListOptions>();
  alarms->add_flag("--all", listed->all, "Also alarms that are acknowledged, muted or over");
  alarms->add_option("--since", listed->since, "Raised since then: 2h, or a time of UTC");
  OneOf(alarms->add_option("--severity", listed->severity, "At least as severe"),
        {"info", "warning", "error"});
  alarms->callback([line, alarms, listed] {
    if (!alarms->get_subcommands().empty()) return;
    line->run = [listed](const Context& context) { return RunList(context, *listed); };
  });

  CLI::App* ack =
      AddCommand(alarms, "ack", "Acknowledge open alarms: somebody has seen them and acts",
                 "  focalfleet alarms ack 12\n  focalfleet alarms ack UnitNeverBegan");
  auto seen = std::make_shared<ChangeOptions>();
  ack->add_option("ALARM", seen->alarms, "Their ids, or names for all open ones of a name")
      ->required();
  OnChosen(line, ack, seen, RunAck);

  CLI::App* mute =
      AddCommand(alarms, "mute", "Do not show alarms of a name as open for a time",
                 "  focalfleet alarms mute CameraLate --for 2h --reason 'dome closed'");
  auto muted = std::make_shared<ChangeOptions>();
  AddName(mute, &muted->alarms);
  mute->add_option("--for", muted->lasts, "How long: 30m, 2h, 7d; at most 31 days")->required();
  mute->add_option("--reason", muted->reason, "Why, for those who come after")->required();
  OnChosen(line, mute, muted, RunMute);

  CLI::App* unmute = AddCommand(alarms, "unmute", "Show alarms of a name as open again",
                                "  focalfleet alarms unmute CameraLate");
  auto unmuted = std::make_shared<ChangeOptions>();
  AddName(unmute, &unmuted->alarms);
  OnChosen(line, unmute, unmuted, RunUnmute);
}

}  // namespace focalfleet::cli
