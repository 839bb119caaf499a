#include "daemon/verbs/alarm_register.h"

#include <algorithm>
#include <utility>
#include <variant>

namespace focalfleet {
namespace {

using State = OpenAlarmRow::State;

/// Alarms of the store itself have no number: they are not stored.
constexpr std::uint64_t kUnstored = 0;

Result<AlarmName> Known(const std::string& text) {
  const AlarmName name = AlarmNameOf(text);
  if (name != AlarmName::kUnnamed) return name;
  return Fail(ErrorCode::kInvalid,
              "there is no alarm '" + text + "'; docs/runbook.md lists their names");
}

bool Lasts(AlarmName name) {
  const AlarmLife life = KindOf(name).life;
  return life == AlarmLife::kCondition || life == AlarmLife::kOfHost;
}

}  // namespace

AlarmRegister::AlarmRegister(const StoredFleet& stored) {
  for (const OpenAlarmRow& row : stored.open_alarms)
    lasting_[Key{row.name, row.unit, row.bus}] = row;
  for (const MuteRow& row : stored.mutes) mutes_[row.name] = row;
}

const OpenAlarmRow* AlarmRegister::Raise(const AlarmRow& alarm, WallTime now) {
  if (KindOf(alarm.name).life == AlarmLife::kNote) return nullptr;
  const auto [at, opened] = lasting_.try_emplace(Key{alarm.name, alarm.unit, alarm.bus});
  OpenAlarmRow& row = at->second;
  if (opened)
    row = {.id = alarm.id,
           .name = alarm.name,
           .severity = alarm.severity,
           .unit = alarm.unit,
           .bus = alarm.bus,
           .count = 0,
           .first_unix_ns = now.ns};
  row.count += alarm.times;
  row.text = alarm.text;
  row.last_unix_ns = now.ns;
  return &row;
}

void AlarmRegister::Take(WallTime now, std::vector<Row>* rows) {
  const std::size_t count = rows->size();
  for (std::size_t k = 0; k < count; ++k) {
    if (const auto* alarm = std::get_if<AlarmRow>(&(*rows)[k])) {
      if (const OpenAlarmRow* open = Raise(*alarm, now)) rows->emplace_back(*open);
    } else if (const auto* end = std::get_if<AlarmEndRow>(&(*rows)[k])) {
      const auto at = lasting_.find(Key{end->name, end->unit, end->bus});
      if (at == lasting_.end()) continue;
      OpenAlarmRow over = std::move(at->second);
      lasting_.erase(at);
      over.state = State::kOver;
      over.ended_unix_ns = now.ns;
      rows->emplace_back(std::move(over));
    }
  }
}

void AlarmRegister::NoteStore(WallTime now, const std::optional<Error>& error) {
  for (const AlarmName name : {AlarmName::kStoreFailing, AlarmName::kStoreFull})
    lasting_.erase(Key{name, {}, {}});
  if (!error) return;
  const AlarmName name =
      error->code == ErrorCode::kFull ? AlarmName::kStoreFull : AlarmName::kStoreFailing;
  Raise({.id = kUnstored,
         .severity = KindOf(name).severity,
         .unit = {},
         .bus = {},
         .text = "the store cannot be written, nothing new is started: " + error->text,
         .name = name},
        now);
}

Result<std::vector<Row>> AlarmRegister::Acknowledge(const std::vector<std::uint64_t>& ids,
                                                    const std::vector<std::string>& names,
                                                    const std::string& by, WallTime now) {
  std::vector<Key> chosen;
  const auto choose = [&](const auto& is_meant) {
    const std::size_t before = chosen.size();
    for (const auto& [key, row] : lasting_)
      if (row.state == State::kOpen && is_meant(row)) chosen.push_back(key);
    return chosen.size() > before;
  };
  for (const std::uint64_t id : ids)
    if (!choose([id](const OpenAlarmRow& row) { return row.id == id; }))
      return Fail(ErrorCode::kInvalid, "alarm " + std::to_string(id) +
                                           " is not open (`focalfleet alarms` has the numbers of "
                                           "those that are; they are not those of units)");
  for (const std::string& text : names) {
    FOCALFLEET_TRY_ASSIGN(const AlarmName name, Known(text));
    if (!choose([name](const OpenAlarmRow& row) { return row.name == name; }))
      return Fail(ErrorCode::kInvalid, "no alarm " + text + " is open");
  }
  if (chosen.empty()) return Fail(ErrorCode::kInvalid, "no alarm named");
  std::vector<Row> rows;
  for (const Key& key : chosen) {
    const auto at = lasting_.find(key);
    if (at == lasting_.end()) continue;  // named twice
    OpenAlarmRow& row = at->second;
    row.state = Lasts(row.name) ? State::kAcknowledged : State::kOver;
    row.acknowledged_unix_ns = now.ns;
    row.acknowledged_by = by;
    if (row.id != kUnstored) rows.emplace_back(row);
    if (row.state == State::kOver) lasting_.erase(at);
  }
  return rows;
}

Result<std::vector<Row>> AlarmRegister::Mute(const std::string& text, WallTime until,
                                             const std::string& reason, const std::string& by,
                                             WallTime now) {
  FOCALFLEET_TRY_ASSIGN(const AlarmName name, Known(text));
  if (until <= now) return Fail(ErrorCode::kInvalid, "a mute needs an end in the future");
  if (reason.empty())
    return Fail(ErrorCode::kInvalid, "say why: whoever misses the alarm will ask");
  const MuteRow row{
      .name = name, .until_unix_ns = until.ns, .since_unix_ns = now.ns, .reason = reason, .by = by};
  mutes_[name] = row;
  return std::vector<Row>{row};
}

Result<std::vector<Row>> AlarmRegister::Unmute(const std::string& text, const std::string& by,
                                               WallTime now) {
  FOCALFLEET_TRY_ASSIGN(const AlarmName name, Known(text));
  if (!IsMuted(name, now)) return Fail(ErrorCode::kRefused, text + " is not muted");
  mutes_.erase(name);
  return std::vector<Row>{MuteRow{.name = name, .since_unix_ns = now.ns, .by = by}};
}

std::vector<OpenAlarmRow> AlarmRegister::Lasting() const {
  std::vector<OpenAlarmRow> rows;
  rows.reserve(lasting_.size());
  for (const auto& [key, row] : lasting_) rows.push_back(row);
  std::ranges::sort(rows, {}, &OpenAlarmRow::id);
  return rows;
}

std::vector<MuteRow> AlarmRegister::Mutes(WallTime now) const {
  std::vector<MuteRow> rows;
  for (const auto& [name, row] : mutes_)
    if (row.until_unix_ns > now.ns) rows.push_back(row);
  return rows;
}

bool AlarmRegister::IsMuted(AlarmName name, WallTime now) const {
  const auto at = mutes_.find(name);
  return at != mutes_.end() && at->second.until_unix_ns > now.ns;
}

AlarmRegister::Counts AlarmRegister::Count(WallTime now) const {
  Counts counts;
  for (const auto& [key, row] : lasting_) {
    if (row.state != State::kOpen) continue;
    if (IsMuted(row.name, now)) {
      ++counts.muted;
      continue;
    }
    ++counts.open;
    counts.worst = std::max(counts.worst.value_or(row.severity), row.severity);
  }
  return counts;
}

}  // namespace focalfleet
