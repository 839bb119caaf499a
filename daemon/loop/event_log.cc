#include "daemon/loop/event_log.h"

#include <spdlog/spdlog.h>

#include <string>
#include <variant>

namespace focalfleet {
namespace {

thread_local const EventFields* fields_of_this_event = nullptr;

/// The fields stand beside the sentences that this thread writes meanwhile.
class WithFields {
 public:
  explicit WithFields(EventFields fields) : fields_(fields) { fields_of_this_event = &fields_; }
  WithFields(const WithFields&) = delete;
  WithFields& operator=(const WithFields&) = delete;
  ~WithFields() { fields_of_this_event = nullptr; }

 private:
  EventFields fields_;
};

spdlog::level::level_enum LevelOf(Severity severity) {
  switch (severity) {
    case Severity::kInfo:
      return spdlog::level::info;
    case Severity::kWarning:
      return spdlog::level::warn;
    case Severity::kError:
      return spdlog::level::err;
  }
  return spdlog::level::err;
}

/// The text of an alarm with its unit or bus; most alarms name it themselves.
std::string TextOf(const AlarmRow& alarm) {
  std::string where;
  if (alarm.bus) where = "bus " + std::to_string(alarm.bus->value);
  if (alarm.unit) where = "unit " + std::to_string(alarm.unit->value);
  return where.empty() || alarm.text.starts_with(where) ? alarm.text : where + ": " + alarm.text;
}

void Log(const AlarmRow& alarm) {
  const WithFields fields({.message_id = kAlarmMessageId,
                           .unit = alarm.unit,
                           .bus = alarm.bus,
                           .configuration = {},
                           .alarm = Name(alarm.name)});
  spdlog::log(LevelOf(alarm.severity), "alarm {} {}: {}", alarm.id, Name(alarm.name),
              TextOf(alarm));
}
/// An end that somebody has seen is in the log already, as what was seen.
void Log(const AlarmEndRow& end) {
  if (end.reason.empty()) return;
  const WithFields fields({.message_id = kAlarmMessageId,
                           .unit = end.unit,
                           .bus = end.bus,
                           .configuration = {},
                           .alarm = Name(end.name)});
  spdlog::info("alarm {} is over: {}", Name(end.name), end.reason);
}
void Log(const ConfigurationRow& row) {
  const WithFields fields(
      {.message_id = kConfigurationMessageId, .unit = {}, .bus = {}, .configuration = row.id});
  spdlog::info(
      "configuration {} ({}) is {}: {} targeted, {} arrived, {} refused, {} failed, {} stopped, "
      "{} unmeasured, makespan {:.1f} s of {:.1f} s predicted",
      row.id, row.source, Name(row.state), row.counts.targeted, row.counts.arrived,
      row.counts.refused, row.counts.failed, row.counts.stopped, row.counts.unmeasured,
      row.makespan_s, row.makespan_predicted_s);
}
void Log(const EnableRow& row) {
  const WithFields fields(
      {.message_id = kUnitEnabledMessageId, .unit = row.unit, .bus = {}, .configuration = {}});
  spdlog::info("unit {} {}{}", row.unit.value, row.enabled ? "enabled" : "disabled: ", row.reason);
}
void Log(const BindingRow& row) {
  spdlog::debug("unit {} is serial {}", row.unit.value, row.serial.value);
}
template <class T>
void Log(const T&) {}

}  // namespace

const EventFields* FieldsOfThisEvent() { return fields_of_this_event; }

void LogRow(const Row& row) {
  std::visit([](const auto& what) { Log(what); }, row);
}

void LogAuditHead(const AuditHead& head) {
  const WithFields fields(
      {.message_id = kAuditHeadMessageId, .unit = {}, .bus = {}, .configuration = {}});
  spdlog::info("audit head {}", Text(head));
}

void LogLink(const LinkEvent& link, const std::string& name, const std::string& trouble) {
  const WithFields fields(
      {.message_id = kBusLinkMessageId, .unit = {}, .bus = link.bus, .configuration = {}});
  spdlog::log(link.state == LinkState::kUp ? spdlog::level::info : spdlog::level::warn,
              "bus {} ({}) is {}{}{}", link.bus.value, name, Name(link.state),
              trouble.empty() ? "" : ": ", trouble);
}

}  // namespace focalfleet
