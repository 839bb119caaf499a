#include "daemon/plane/plane_alarms.h"

#include <utility>
#include <variant>
#include <vector>

#include "daemon/loop/event_log.h"
#include "daemon/verbs/alarm_requests.h"

namespace focalfleet {

std::vector<AlarmValue> PlaneAlarms::Take(std::span<const ShellNote> notes, WallTime now) {
  std::vector<AlarmValue> values;
  std::vector<Row> rows;
  for (const ShellNote& note : notes) {
    const AlarmRow alarm{.id = next_id_++,
                         .severity = KindOf(note.name).severity,
                         .unit = {},
                         .bus = {},
                         .text = note.text,
                         .name = note.name};
    values.push_back({.at = now, .row = alarm});
    rows.emplace_back(alarm);
    LogRow(rows.back());
    if (note.ends) rows.emplace_back(AlarmEndRow{.name = *note.ends, .unit = {}, .bus = {}});
  }
  if (!rows.empty()) open_.Take(now, &rows);
  return values;
}

Result<Json> PlaneAlarms::Answer(const ControlRequest& request, const std::string& by,
                                 WallTime now) {
  if (request.verb == "alarms") {
    FOCALFLEET_TRY_ASSIGN(const bool all, FlagArgumentOr(request.args, "all", false));
    if (all)
      return Fail(ErrorCode::kRefused,
                  "a plane's coordinator keeps no alarms that are over: its log has them, and each "
                  "sector's daemon has its own");
    FOCALFLEET_TRY_ASSIGN(const StoreReading reading, AskAlarms(request, open_, now));
    return reading(nullptr);
  }
  const auto change = ChangeAlarms(request, &open_, by, now);
  if (!change) return Fail(ErrorCode::kInvalid, "there is no verb '" + request.verb + "'");
  if (!*change) return tl::unexpected<Error>(change->error());
  return Json{{"text", std::get<KeepRowsCommand>((*change)->what).text}};
}

Json PlaneAlarms::CountsJson(WallTime now) const {
  const AlarmRegister::Counts counts = open_.Count(now);
  return {{"open", counts.open},
          {"muted", counts.muted},
          {"worst", counts.worst ? Json(Name(*counts.worst)) : Json()}};
}

}  // namespace focalfleet
