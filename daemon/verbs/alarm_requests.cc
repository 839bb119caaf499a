#include "daemon/verbs/alarm_requests.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "fleet/alarm_name.h"

namespace focalfleet {
namespace {

constexpr std::uint64_t kEarlierAlarmsMax = 1000;
/// The longest mute. A month spans a repair; what is to be silent for longer is no alarm.
constexpr double kMuteMaxS = 31 * 86'400.0;

Json TimeOrNull(std::int64_t unix_ns) { return unix_ns == 0 ? Json() : Json(ToIso8601({unix_ns})); }

Json JsonOf(const OpenAlarmRow& row, bool muted) {
  constexpr const char* kStates[] = {"open", "acknowledged", "over"};
  return {{"id", row.id},
          {"name", Name(row.name)},
          {"severity", Name(row.severity)},
          {"state", kStates[static_cast<std::size_t>(row.state)]},
          {"muted", muted},
          {"unit_id", row.unit ? Json(row.unit->value) : Json()},
          {"bus_id", row.bus ? Json(row.bus->value) : Json()},
          {"text", row.text},
          {"count", row.count},
          {"first", ToIso8601({row.first_unix_ns})},
          {"last", ToIso8601({row.last_unix_ns})},
          {"acknowledged", TimeOrNull(row.acknowledged_unix_ns)},
          {"acknowledged_by", row.acknowledged_by},
          {"ended", TimeOrNull(row.ended_unix_ns)},
          {"runbook", RunbookOf(row.name)}};
}

/// Alarms of the muted name that are open, and those of them that have begun since it was muted.
struct MutedCounts {
  std::size_t open = 0;
  std::size_t since = 0;
};

MutedCounts CountMuted(const std::vector<OpenAlarmRow>& lasting, const MuteRow& mute) {
  MutedCounts counts;
  for (const OpenAlarmRow& row : lasting) {
    if (row.name != mute.name || row.state != OpenAlarmRow::State::kOpen) continue;
    ++counts.open;
    if (row.first_unix_ns > mute.since_unix_ns) ++counts.since;
  }
  return counts;
}

Json JsonOf(const MuteRow& row, const MutedCounts& counts) {
  return {{"name", Name(row.name)},
          {"since", ToIso8601({row.since_unix_ns})},
          {"until", ToIso8601({row.until_unix_ns})},
          {"reason", row.reason},
          {"by", row.by},
          {"open", counts.open},
          {"open_since", counts.since}};
}

Json AlarmsJson(const std::vector<OpenAlarmRow>& rows, Severity least, const AlarmRegister& alarms,
                WallTime now) {
  Json list = Json::array();
  for (const OpenAlarmRow& row : rows)
    if (row.severity >= least) list.push_back(JsonOf(row, alarms.IsMuted(row.name, now)));
  Json mutes = Json::array();
  const std::vector<OpenAlarmRow> lasting = alarms.Lasting();
  for (const MuteRow& mute : alarms.Mutes(now))
    mutes.push_back(JsonOf(mute, CountMuted(lasting, mute)));
  const AlarmRegister::Counts counts = alarms.Count(now);
  return {{"open", counts.open},
          {"muted", counts.muted},
          {"alarms", std::move(list)},
          {"mutes", std::move(mutes)}};
}

Result<std::vector<std::uint64_t>> Ids(const Json& args) {
  if (!args.contains("ids")) return std::vector<std::uint64_t>();
  FOCALFLEET_TRY_ASSIGN(const auto ids, UnsignedListArgument(args, "ids"));
  return std::vector<std::uint64_t>(ids.begin(), ids.end());
}

Result<std::vector<std::string>> Names(const Json& args) {
  std::vector<std::string> names;
  if (!args.contains("names")) return names;
  const Json& list = args["names"];
  if (!list.is_array()) return Fail(ErrorCode::kInvalid, "names must be a list of texts");
  for (const Json& name : list) {
    if (!name.is_string()) return Fail(ErrorCode::kInvalid, "names must be a list of texts");
    names.push_back(name.get<std::string>());
  }
  return names;
}

Command Keep(std::vector<Row> rows, std::string text) {
  Command command;
  command.what = KeepRowsCommand{std::move(rows), std::move(text)};
  return command;
}

Result<Command> Acknowledge(const Json& args, AlarmRegister* alarms, const std::string& by,
                            WallTime now) {
  FOCALFLEET_TRY_ASSIGN(const auto ids, Ids(args));
  FOCALFLEET_TRY_ASSIGN(const auto names, Names(args));
  FOCALFLEET_TRY_ASSIGN(auto rows, alarms->Acknowledge(ids, names, by, now));
  const std::string count = std::to_string(rows.size());
  return Keep(std::move(rows),
              count + (count == "1" ? " alarm is" : " alarms are") + " acknowledged");
}

Result<Command> Mute(const Json& args, AlarmRegister* alarms, const std::string& by, WallTime now) {
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "name"));
  FOCALFLEET_TRY_ASSIGN(const std::string reason, TextArgument(args, "reason"));
  FOCALFLEET_TRY_ASSIGN(const double for_s, NumberArgument(args, "for_s"));
  if (!(for_s > 0 && for_s <= kMuteMaxS))
    return Fail(ErrorCode::kInvalid, "for_s must be above 0 and at most 31 days");
  const WallTime until{now.ns + static_cast<std::int64_t>(for_s * 1e9)};
  FOCALFLEET_TRY_ASSIGN(auto rows, alarms->Mute(name, until, reason, by, now));
  return Keep(std::move(rows), name + " is muted until " + ToIso8601(until));
}

Result<Command> Unmute(const Json& args, AlarmRegister* alarms, const std::string& by,
                       WallTime now) {
  FOCALFLEET_TRY_ASSIGN(const std::string name, TextArgument(args, "name"));
  FOCALFLEET_TRY_ASSIGN(auto rows, alarms->Unmute(name, by, now));
  return Keep(std::move(rows), name + " is no longer muted");
}

}  // namespace

Result<StoreReading> AskAlarms(const ControlRequest& request, const AlarmRegister& alarms,
                               WallTime now) {
  const Json& args = request.args;
  FOCALFLEET_TRY_ASSIGN(const bool all, FlagArgumentOr(args, "all", false));
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t limit,
                        UnsignedArgumentOr(args, "limit", kEarlierAlarmsMax));
  FOCALFLEET_TRY_ASSIGN(const Severity least, SeverityArgumentOr(args, Severity::kInfo));
  FOCALFLEET_TRY_ASSIGN(const Period period, PeriodArgument(args));
  return StoreReading([all, least, period, now, alarms,
                       earlier_most = static_cast<std::uint32_t>(std::min(
                           limit, kEarlierAlarmsMax))](StoreReader* store) -> Result<Json> {
    std::vector<OpenAlarmRow> rows = alarms.Lasting();
    std::erase_if(rows, [&](const OpenAlarmRow& row) {
      return row.last_unix_ns < period.since.ns ||
             (!all && row.state == OpenAlarmRow::State::kAcknowledged);
    });
    if (all) {
      FOCALFLEET_TRY_ASSIGN(auto earlier, store->EarlierAlarms(earlier_most, period));
      // The store is read a little later than the register: an alarm that ended meanwhile is once.
      std::erase_if(earlier, [&](const OpenAlarmRow& row) {
        return std::ranges::find(rows, row.id, &OpenAlarmRow::id) != rows.end();
      });
      rows.insert(rows.begin(), std::make_move_iterator(earlier.rbegin()),
                  std::make_move_iterator(earlier.rend()));
      std::ranges::stable_sort(rows, {}, &OpenAlarmRow::id);
    }
    return AlarmsJson(rows, least, alarms, now);
  });
}

std::optional<Result<Command>> ChangeAlarms(const ControlRequest& request, AlarmRegister* alarms,
                                            const std::string& by, WallTime now) {
  if (request.verb == "alarms_ack") return Acknowledge(request.args, alarms, by, now);
  if (request.verb == "alarms_mute") return Mute(request.args, alarms, by, now);
  if (request.verb == "alarms_unmute") return Unmute(request.args, alarms, by, now);
  return std::nullopt;
}

}  // namespace focalfleet
