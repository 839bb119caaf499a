#include "daemon/verbs/history_requests.h"

#include <algorithm>
#include <functional>
#include <iterator>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/status/history_json.h"
#include "daemon/status/status_json.h"
#include "daemon/verbs/requested_command.h"
#include "daemon/verbs/unit_selection.h"
#include "fleet/row_check.h"

namespace focalfleet {
namespace {

constexpr std::uint64_t kHistoryRowsMax = 1000;
constexpr std::uint64_t kParameterRowsMax = 1000;
/// Rows of a table that are looked at for events of some units or severities: some 20 ms.
constexpr std::uint32_t kRowsLookedAt = 10'000;
/// Entries that one page of a follower goes on by, of all kinds together.
constexpr std::uint32_t kPageEntries = 1000;

Result<std::uint32_t> LimitArgument(const Json& args, std::uint64_t otherwise) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t asked, UnsignedArgumentOr(args, "limit", otherwise));
  return static_cast<std::uint32_t>(std::min(asked, kHistoryRowsMax));
}

/// The code of {state?} among those up to `last`; none: not given.
template <class Enum>
Result<std::optional<Enum>> StateArgument(const Json& args, Enum last) {
  if (!args.contains("state")) return std::optional<Enum>();
  FOCALFLEET_TRY_ASSIGN(const std::string text, TextArgument(args, "state"));
  std::string known;
  for (std::uint8_t code = 0; code <= static_cast<std::uint8_t>(last); ++code) {
    if (text == Name(static_cast<Enum>(code))) return std::optional(static_cast<Enum>(code));
    known += std::string(known.empty() ? "" : ", ") + Name(static_cast<Enum>(code));
  }
  return Fail(ErrorCode::kInvalid, "there is no state '" + text + "'; they are " + known);
}

struct Event {
  WallTime at;
  Severity severity = Severity::kInfo;
  const char* kind = "";
  Json name;
  std::optional<UnitId> unit = {};
  std::optional<BusId> bus = {};
  std::string text = {};
};

Event EventOf(const AlarmHistory& alarm) {
  return {.at = alarm.at,
          .severity = alarm.row.severity,
          .kind = "alarm",
          .name = Name(alarm.row.name),
          .unit = alarm.row.unit,
          .bus = alarm.row.bus,
          .text = alarm.row.text};
}

Event EventOf(const UnitHistory& unit) {
  std::string text = "unit " + std::to_string(unit.unit.value) + ": ";
  if (unit.serial.value != 0) text += "serial " + std::to_string(unit.serial.value) + ", ";
  text += unit.enabled ? "enabled" : "disabled: " + unit.reason;
  return {.at = unit.at, .kind = "unit", .name = {}, .unit = unit.unit, .text = std::move(text)};
}

std::string Named(const ConfigurationRow& row) {
  return "configuration " + std::to_string(row.id) + " (" + row.source + ")";
}

Event BeginOf(const ConfigurationHistory& entry) {
  return {.at = entry.began,
          .kind = "configuration",
          .name = {},
          .text = Named(entry.row) + " begins: " + std::to_string(entry.row.counts.targeted) +
                  " targeted"};
}

Event EndOf(const ConfigurationHistory& entry) {
  const ConfigurationRow& row = entry.row;
  std::string text = Named(row) + " is " + Name(row.state) + ": " +
                     std::to_string(row.counts.arrived) + " of " +
                     std::to_string(row.counts.targeted) + " arrived";
  const std::pair<const char*, std::uint32_t> rest[] = {{"refused", row.counts.refused},
                                                        {"failed", row.counts.failed},
                                                        {"stopped", row.counts.stopped},
                                                        {"unmeasured", row.counts.unmeasured}};
  for (const auto& [what, count] : rest)
    if (count > 0) text += ", " + std::to_string(count) + " " + what;
  const bool well =
      row.state == ConfigurationState::kDone && row.counts.arrived == row.counts.targeted;
  return {.at = entry.changed,
          .severity = well ? Severity::kInfo : Severity::kWarning,
          .kind = "configuration",
          .name = {},
          .text = std::move(text)};
}

Json JsonOf(const Event& event) {
  return {{"at", ToIso8601(event.at)},
          {"at_ns", event.at.ns},
          {"severity", Name(event.severity)},
          {"kind", event.kind},
          {"name", event.name},
          {"unit_id", event.unit ? Json(event.unit->value) : Json()},
          {"bus_id", event.bus ? Json(event.bus->value) : Json()},
          {"text", event.text}};
}

/// The newest value of each axis and parameter; `history` is newest first.
Json NewestOf(const std::vector<ParameterHistory>& history) {
  std::vector<ParameterHistory> newest;
  for (const ParameterHistory& entry : history) {
    const bool known = std::ranges::any_of(newest, [&](const ParameterHistory& other) {
      return other.row.axis == entry.row.axis && other.row.parameter == entry.row.parameter;
    });
    if (!known) newest.push_back(entry);
  }
  return HistoryJson(newest);
}

/// The newest of each axis; `history` is newest first.
Json NewestOf(const std::vector<TuningHistory>& history) {
  std::vector<TuningHistory> newest;
  for (const TuningHistory& entry : history)
    if (std::ranges::none_of(
            newest, [&](const TuningHistory& other) { return other.row.axis == entry.row.axis; }))
      newest.push_back(entry);
  return HistoryJson(newest);
}

/// The measurements of the unit in the configurations of its moves, the newest first.
Result<std::vector<UnitMeasured>> MeasuredAfter(const std::vector<MoveHistory>& moves, UnitId unit,
                                                StoreReader* store) {
  std::set<std::uint64_t, std::greater<>> configurations;
  for (const MoveHistory& move : moves) configurations.insert(move.configuration);
  std::vector<UnitMeasured> measured;
  for (const std::uint64_t configuration : configurations) {
    FOCALFLEET_TRY_ASSIGN(const auto some, store->MeasurementsOf(unit, configuration));
    measured.insert(measured.end(), some.begin(), some.end());
  }
  return measured;
}

/// All events of the period, as far as they are looked at and not after `newest`, in any order.
Result<std::vector<Event>> EventsIn(const Period& period, const EntryNumbers& newest,
                                    StoreReader* store) {
  std::vector<Event> events;
  FOCALFLEET_TRY_ASSIGN(const auto alarms, store->Alarms(kRowsLookedAt, period));
  for (const AlarmHistory& alarm : alarms)
    if (alarm.row.id <= newest.alarm) events.push_back(EventOf(alarm));
  FOCALFLEET_TRY_ASSIGN(const auto units, store->Units(std::nullopt, kRowsLookedAt, period));
  for (const UnitHistory& unit : units)
    if (unit.entry <= newest.unit) events.push_back(EventOf(unit));
  FOCALFLEET_TRY_ASSIGN(const auto configurations,
                        store->Configurations(kRowsLookedAt, {.since = period.since}));
  for (const ConfigurationHistory& entry : configurations) {
    if (entry.row.id <= newest.begun) events.push_back(BeginOf(entry));
    if (entry.row.id <= newest.ended && IsOver(entry.row.state)) events.push_back(EndOf(entry));
  }
  std::erase_if(events, [&](const Event& event) {
    return event.at < period.since || event.at >= period.until;
  });
  return events;
}

/// The entries of one kind that wait for their turn in a page.
struct Queue {
  std::vector<Event> events;
  std::vector<std::uint64_t> numbers;  // of each
  std::uint64_t* reached = nullptr;    // the number that the page goes on to
  std::size_t next = 0;

  [[nodiscard]] bool empty() const { return next == events.size(); }
};

struct Page {
  std::vector<Event> events;
  EntryNumbers reached;
  bool more = false;
};

/// The oldest entries after `after`. Each kind keeps its own order, and the kinds are merged by
/// time: a clock that was set back mixes them, and hides none.
Result<Page> PageAfter(const EntryNumbers& after, StoreReader* store) {
  FOCALFLEET_TRY_ASSIGN(const EntriesAfter entries, store->After(after, kPageEntries + 1));
  Page page{.events = {}, .reached = after};
  Queue queues[] = {{.reached = &page.reached.alarm},
                    {.reached = &page.reached.unit},
                    {.reached = &page.reached.begun},
                    {.reached = &page.reached.ended}};
  const auto add = [](Queue* queue, Event event, std::uint64_t number) {
    queue->events.push_back(std::move(event));
    queue->numbers.push_back(number);
  };
  for (const AlarmHistory& alarm : entries.alarms) add(&queues[0], EventOf(alarm), alarm.row.id);
  for (const UnitHistory& unit : entries.units) add(&queues[1], EventOf(unit), unit.entry);
  for (const auto& entry : entries.begun) add(&queues[2], BeginOf(entry), entry.row.id);
  for (const auto& entry : entries.ended) add(&queues[3], EndOf(entry), entry.row.id);
  for (;;) {
    Queue* oldest = nullptr;
    for (Queue& queue : queues)
      if (!queue.empty() &&
          (oldest == nullptr || queue.events[queue.next].at < oldest->events[oldest->next].at))
        oldest = &queue;
    page.more = oldest != nullptr;
    if (oldest == nullptr || page.events.size() == kPageEntries) return page;
    *oldest->reached = oldest->numbers[oldest->next];
    page.events.push_back(std::move(oldest->events[oldest->next++]));
  }
}

Json JsonOf(const EntryNumbers& numbers) {
  return {{"alarm", numbers.alarm},
          {"unit", numbers.unit},
          {"begun", numbers.begun},
          {"ended", numbers.ended}};
}

/// {after?}; none: not given.
Result<std::optional<EntryNumbers>> AfterArgument(const Json& args) {
  if (!args.contains("after")) return std::optional<EntryNumbers>();
  const Json& after = args["after"];
  if (!after.is_object())
    return Fail(ErrorCode::kInvalid, "after must be `next` of an earlier answer");
  EntryNumbers numbers;
  const std::pair<const char*, std::uint64_t*> members[] = {{"alarm", &numbers.alarm},
                                                            {"unit", &numbers.unit},
                                                            {"begun", &numbers.begun},
                                                            {"ended", &numbers.ended}};
  for (const auto& [name, number] : members) {
    FOCALFLEET_TRY_ASSIGN(*number, UnsignedArgument(after, name));
    if (*number > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
      return Fail(ErrorCode::kInvalid, std::string("after has no such ") + name);
  }
  return std::optional(numbers);
}

}  // namespace

Result<Period> PeriodArgument(const Json& args) {
  Period period;
  if (args.contains("since_ns")) {
    FOCALFLEET_TRY_ASSIGN(period.since.ns, IntegerArgument(args, "since_ns"));
  }
  if (args.contains("until_ns")) {
    FOCALFLEET_TRY_ASSIGN(period.until.ns, IntegerArgument(args, "until_ns"));
  }
  return period;
}

Result<Severity> SeverityArgumentOr(const Json& args, Severity otherwise) {
  if (!args.contains("severity")) return otherwise;
  FOCALFLEET_TRY_ASSIGN(const std::string text, TextArgument(args, "severity"));
  for (const Severity severity : {Severity::kInfo, Severity::kWarning, Severity::kError})
    if (text == Name(severity)) return severity;
  return Fail(ErrorCode::kInvalid, "severity must be info, warning or error, not '" + text + "'");
}

Result<StoreReading> AskHistory(const ControlRequest& request, const FleetView& view) {
  const Json& args = request.args;
  FOCALFLEET_TRY_ASSIGN(const std::uint32_t limit, LimitArgument(args, 20));
  FOCALFLEET_TRY_ASSIGN(const Period period, PeriodArgument(args));
  if (!args.contains("unit_id")) {
    FOCALFLEET_TRY_ASSIGN(const auto state, StateArgument(args, kLastConfigurationState));
    return StoreReading([limit, period, state](StoreReader* store) -> Result<Json> {
      FOCALFLEET_TRY_ASSIGN(const auto configurations, store->Configurations(limit, period, state));
      // A state is one of configurations; alarms have none.
      if (state) return Json{{"configurations", HistoryJson(configurations)}};
      FOCALFLEET_TRY_ASSIGN(const auto alarms, store->Alarms(limit, period));
      return Json{{"configurations", HistoryJson(configurations)}, {"alarms", HistoryJson(alarms)}};
    });
  }
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(args, *view.layout));
  FOCALFLEET_TRY_ASSIGN(const auto end, StateArgument(args, kLastIntentEnd));
  const UnitId id = view.layout->unit(i).id;
  return StoreReading([limit, period, end, id](StoreReader* store) -> Result<Json> {
    FOCALFLEET_TRY_ASSIGN(const auto moves, store->Moves(id, limit, period, end));
    if (end) return Json{{"moves", HistoryJson(moves)}};
    FOCALFLEET_TRY_ASSIGN(const auto places, store->Units(id, limit, period));
    FOCALFLEET_TRY_ASSIGN(const auto measured, MeasuredAfter(moves, id, store));
    return Json{{"moves", HistoryJson(moves)},
                {"measured", HistoryJson(measured)},
                {"unit", HistoryJson(places)}};
  });
}

Result<StoreReading> AskEvents(const ControlRequest& request, const FleetView& view) {
  const Json& args = request.args;
  FOCALFLEET_TRY_ASSIGN(const std::uint32_t limit, LimitArgument(args, 100));
  FOCALFLEET_TRY_ASSIGN(const Period period, PeriodArgument(args));
  FOCALFLEET_TRY_ASSIGN(const auto after, AfterArgument(args));
  FOCALFLEET_TRY_ASSIGN(const Severity least, SeverityArgumentOr(args, Severity::kInfo));
  std::set<UnitId> wanted;
  if (args.contains("unit_ids")) {
    FOCALFLEET_TRY_ASSIGN(const auto units,
                          SelectUnits(Json{{"unit_ids", args["unit_ids"]}}, view));
    for (const PositionerIndex i : units) wanted.insert(view.layout->unit(i).id);
  }
  return StoreReading([limit, period, after, least, wanted](StoreReader* store) -> Result<Json> {
    Page page;
    if (after) {
      FOCALFLEET_TRY_ASSIGN(page, PageAfter(*after, store));
    } else {
      FOCALFLEET_TRY_ASSIGN(page.reached, store->NewestEntries());
      FOCALFLEET_TRY_ASSIGN(page.events, EventsIn(period, page.reached, store));
      std::ranges::stable_sort(page.events, {}, &Event::at);
    }
    std::vector<Event>& events = page.events;
    std::erase_if(events, [&](const Event& event) {
      return event.severity < least ||
             (!wanted.empty() && !(event.unit && wanted.contains(*event.unit)));
    });
    Json list = Json::array();
    const std::size_t first =
        after ? 0 : events.size() - std::min<std::size_t>(events.size(), limit);
    for (std::size_t k = first; k < events.size(); ++k) list.push_back(JsonOf(events[k]));
    return Json{{"events", std::move(list)}, {"next", JsonOf(page.reached)}, {"more", page.more}};
  });
}

Result<StoreReading> AskParameters(const ControlRequest& request, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const PositionerIndex i, UnitArgument(request.args, *view.layout));
  const UnitView& unit = view.coordinator->unit(i);
  const SerialNumber serial = unit.bound_serial.value != 0 ? unit.bound_serial : unit.serial;
  const Json known = UnitJson(view, i);
  Json drive = {{"mode", known["mode"]}, {"v_bus_V", known["v_bus_V"]}};
  for (const char* axis : {"theta", "phi"})
    for (const char* name : {"counter1", "repeat", "subdivision"})
      drive[std::string(axis) + "_" + name] = known[axis][name];
  const std::uint32_t id = view.layout->unit(i).id.value;
  return StoreReading([id, serial, drive](StoreReader* store) -> Result<Json> {
    FOCALFLEET_TRY_ASSIGN(const auto history, store->Parameters(serial, kParameterRowsMax));
    FOCALFLEET_TRY_ASSIGN(const auto tunings, store->Tunings(serial, kParameterRowsMax));
    return Json{{"unit_id", id},
                {"serial", serial.value},
                {"drive", drive},  // effective values, stored or by default
                {"parameters", NewestOf(history)},
                {"tuning", NewestOf(tunings)},
                {"tuning_history", HistoryJson(tunings)},
                {"history", HistoryJson(history)}};
  });
}

Result<StoreReading> AskMeasurements(const ControlRequest& request, const FleetView& view) {
  FOCALFLEET_TRY_ASSIGN(const std::uint64_t asked, UnsignedArgumentOr(request.args, "exposure", 0));
  const std::uint64_t configuration = view.coordinator->configuration().id;
  return StoreReading([asked, configuration](StoreReader* store) -> Result<Json> {
    std::uint64_t exposure = asked;
    if (exposure == 0) {
      FOCALFLEET_TRY_ASSIGN(const auto last, store->LastExposure(configuration));
      if (!last) return Fail(ErrorCode::kRefused, "the last configuration was not measured");
      exposure = *last;
    }
    FOCALFLEET_TRY_ASSIGN(const auto rows, store->Measurements(exposure));
    if (rows.empty())
      return Fail(ErrorCode::kRefused, "there is no exposure " + std::to_string(exposure));
    return Json{{"exposure", exposure}, {"measurements", HistoryJson(rows)}};
  });
}

}  // namespace focalfleet
