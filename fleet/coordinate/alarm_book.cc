#include "fleet/coordinate/alarm_book.h"

#include <algorithm>
#include <utility>

namespace focalfleet {
namespace {

/// The first kNotedSingly of equal alarms within the window are noted, and the others become one. A
/// controller that flaps a thousand times a second is then four rows a minute. With half of the
/// window an operator who looks each minute finds two lines, with twice as much the newest state is
/// two minutes old.
constexpr DurationNs kFoldWindow = Seconds(60);
constexpr std::uint32_t kNotedSingly = 3;
/// A condition whose alarm was folded is noted once it has lasted for so long. Half would note each
/// flap of a slow one; with twice as much, operators would see it later than they look.
constexpr DurationNs kFoldedLasts = Seconds(2);

bool HasLife(AlarmName name) {
  const AlarmLife life = KindOf(name).life;
  return life == AlarmLife::kCondition || life == AlarmLife::kOfHost;
}

/// The reason why a condition ends where the thing that it is about is there no more; else empty.
std::string WhatLeft(const Layout& layout, const CoordinatorConfig& config, AlarmName name,
                     std::optional<UnitId> unit, std::optional<BusId> bus) {
  using enum AlarmName;
  const auto place = unit ? layout.Find(*unit) : std::nullopt;
  if (unit && !place) return "unit " + std::to_string(unit->value) + " left the layout";
  if (bus && std::ranges::find(layout.buses(), *bus) == layout.buses().end())
    return "bus " + std::to_string(bus->value) + " left the layout";
  if (!config.has_camera &&
      (name == kCameraLate || name == kCameraFailed || name == kExposureRefused))
    return "the camera left the configuration";
  if (place && (name == kSensorsSilent || name == kSensorsDoubted) &&
      (!config.reads_sensors || layout.unit(*place).sensors == 0))
    return "the sensors of unit " + std::to_string(unit->value) + " left the configuration";
  return {};
}

}  // namespace

AlarmBook::AlarmBook(const Layout& layout, const CoordinatorConfig& config,
                     const StoredFleet& stored, const StepState& step)
    : layout_(layout), config_(config), step_(step), next_alarm_(stored.next_alarm) {
  for (const auto& row : stored.open_alarms) {
    const Condition condition{row.name, row.unit, row.bus};
    if (HasLife(row.name)) conditions_.insert(condition);
    if (KindOf(row.name).life == AlarmLife::kOfHost) unconfirmed_.insert(condition);
  }
}

void AlarmBook::BeginStep() {
  EndUnconfirmed();
  NoteFolded();
}

void AlarmBook::Raise(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus,
                      std::string text) {
  Condition alarm{name, {}, bus};
  if (unit) alarm.unit = layout_.unit(*unit).id;
  bool lasted = false;
  if (HasLife(name)) {
    lasted = !conditions_.insert(alarm).second;
    unconfirmed_.erase(alarm);
  }
  const auto [at, is_first] = repeats_.try_emplace(alarm, Repeats{step_.now, step_.now, step_.now});
  Repeats& repeats = at->second;
  repeats.last = step_.now;
  if (!lasted) repeats.begun = step_.now;
  if (repeats.noted < kNotedSingly) {
    ++repeats.noted;
    fold_at_ = std::min(fold_at_, repeats.since + kFoldWindow);
    NoteAlarm(alarm, std::move(text), 1);
    return;
  }
  repeats.alike = repeats.folded == 0 || (repeats.alike && repeats.text == text);
  ++repeats.folded;
  repeats.text = std::move(text);
  fold_at_ = std::min(fold_at_, step_.now + kFoldedLasts);
}

void AlarmBook::Explain(AlarmName name, PositionerIndex unit, std::string text) {
  const Condition alarm{name, layout_.unit(unit).id, {}};
  if (!conditions_.contains(alarm)) return;
  const auto at = repeats_.find(alarm);
  if (at != repeats_.end() && at->second.folded > 0)
    at->second.text = std::move(text);
  else
    NoteAlarm(alarm, std::move(text), 0);
}

void AlarmBook::NoteAlarm(const Condition& alarm, std::string text, std::uint32_t times) {
  Note(AlarmRow{.id = next_alarm_++,
                .severity = KindOf(alarm.name).severity,
                .unit = alarm.unit,
                .bus = alarm.bus,
                .text = std::move(text),
                .name = alarm.name,
                .times = times});
}

void AlarmBook::NoteRepeats(const Condition& alarm, const Repeats& repeats) {
  const auto seconds_since = [this](HostInstant at) {
    return std::to_string((step_.now - at).ns / Seconds(1).ns);
  };
  const bool is_old = step_.now - repeats.last >= Seconds(1);
  NoteAlarm(alarm,
            repeats.text + " (" + std::to_string(repeats.folded) +
                (repeats.alike ? " times more in " : " of its kind in ") +
                seconds_since(repeats.since) + " s" +
                (is_old ? ", the last " + seconds_since(repeats.last) + " s ago)" : ")"),
            repeats.folded);
  if (HasLife(alarm.name) && !conditions_.contains(alarm))
    Note(AlarmEndRow{alarm.name, alarm.unit, alarm.bus});
}

// The window after one with folded alarms has no single ones: what goes on stays one line a window.
void AlarmBook::NoteFolded() {
  if (step_.now < fold_at_) return;
  fold_at_ = kNever;
  for (auto at = repeats_.begin(); at != repeats_.end();) {
    const Condition& alarm = at->first;
    Repeats& repeats = at->second;
    const bool window_over = step_.now - repeats.since >= kFoldWindow;
    const bool lasts = HasLife(alarm.name) && conditions_.contains(alarm);
    const bool lasts_long = lasts && step_.now - repeats.begun >= kFoldedLasts;
    if (repeats.folded > 0 && (window_over || lasts_long)) {
      NoteRepeats(alarm, repeats);
      if (window_over) repeats.since = step_.now;
      repeats.folded = 0;
    } else if (window_over) {
      at = repeats_.erase(at);
      continue;
    }
    fold_at_ = std::min(fold_at_, repeats.since + kFoldWindow);
    if (repeats.folded > 0 && lasts) fold_at_ = std::min(fold_at_, repeats.begun + kFoldedLasts);
    ++at;
  }
}

void AlarmBook::NoteAllFolded() {
  for (auto& [alarm, repeats] : repeats_) {
    if (repeats.folded > 0) NoteRepeats(alarm, repeats);
    repeats.folded = 0;
  }
}

bool AlarmBook::Lasts(AlarmName name, PositionerIndex unit) const {
  return conditions_.contains({name, layout_.unit(unit).id, {}});
}

void AlarmBook::End(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus) {
  if (conditions_.empty()) return;
  Condition condition{name, {}, bus};
  if (unit) condition.unit = layout_.unit(*unit).id;
  if (conditions_.erase(condition) > 0) Note(AlarmEndRow{name, condition.unit, bus});
  unconfirmed_.erase(condition);
}

// A bus that is up, or DDS that works, is reported by nobody. An alarm of an earlier run about them
// is over where this run does not raise it again.
void AlarmBook::EndUnconfirmed() {
  if (confirm_until_ == kNever) {
    confirm_until_ = step_.now + config_.confirm_within;
    EndOfWhatLeft();
  }
  if (unconfirmed_.empty() || step_.now < confirm_until_) return;
  for (const Condition& condition : unconfirmed_) {
    conditions_.erase(condition);
    Note(AlarmEndRow{condition.name, condition.unit, condition.bus});
  }
  unconfirmed_.clear();
}

// Nobody will see these conditions end.
void AlarmBook::EndOfWhatLeft() {
  for (auto it = conditions_.begin(); it != conditions_.end();) {
    const Condition condition = *it;
    std::string why = WhatLeft(layout_, config_, condition.name, condition.unit, condition.bus);
    if (why.empty()) {
      ++it;
      continue;
    }
    it = conditions_.erase(it);
    unconfirmed_.erase(condition);
    Note(AlarmEndRow{condition.name, condition.unit, condition.bus, std::move(why)});
  }
}

}  // namespace focalfleet
