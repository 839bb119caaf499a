#include "fleet/coordinate/ledger.h"

#include <algorithm>
#include <utility>

#include "protocol/base/limits.h"

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

MoveId MoveAfter(MoveId move, std::uint32_t count) {
  constexpr std::uint32_t kIds = 65'535;  // 0 is none
  return {static_cast<std::uint16_t>((move.value + count - 1) % kIds + 1)};
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

Ledger::Ledger(const Layout& layout, const CoordinatorConfig& config, StoredFleet stored,
               const StepState& step)
    : earlier_configurations(std::move(stored.configurations)),
      layout_(layout),
      config_(config),
      step_(step),
      next_configuration_(stored.next_configuration),
      next_alarm_(stored.next_alarm),
      next_exposure_(stored.next_exposure),
      next_move_(stored.next_move) {
  for (const auto& row : stored.vectors) vectors[row.serial] = row;
  for (const auto& row : stored.open_intents) intents[row.serial] = row;
  for (const auto& row : stored.open_alarms) {
    const AlarmLife life = KindOf(row.name).life;
    const Condition condition{row.name, row.unit, row.bus};
    if (life == AlarmLife::kCondition || life == AlarmLife::kOfHost) conditions_.insert(condition);
    if (life == AlarmLife::kOfHost) unconfirmed_.insert(condition);
  }
}

MoveId Ledger::TakeMoveId() {
  const MoveId taken = next_move_;
  next_move_ = MoveAfter(taken, 1);
  if (--moves_left_ < limits::kMovesReserved / 2) ReserveMoves();
  return taken;
}

void Ledger::ReserveMoves() {
  moves_left_ = limits::kMovesReserved;
  Note(NextMoveRow{MoveAfter(next_move_, moves_left_)});
  if (reserved_by_ == 0) reserved_by_ = batch_now();
}

void Ledger::Raise(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus,
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

void Ledger::NoteAlarm(const Condition& alarm, std::string text, std::uint32_t times) {
  Note(AlarmRow{.id = next_alarm_++,
                .severity = KindOf(alarm.name).severity,
                .unit = alarm.unit,
                .bus = alarm.bus,
                .text = std::move(text),
                .name = alarm.name,
                .times = times});
}

void Ledger::NoteRepeats(const Condition& alarm, const Repeats& repeats) {
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
void Ledger::NoteFolded() {
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

void Ledger::NoteAllFolded() {
  for (auto& [alarm, repeats] : repeats_) {
    if (repeats.folded > 0) NoteRepeats(alarm, repeats);
    repeats.folded = 0;
  }
}

bool Ledger::Lasts(AlarmName name, PositionerIndex unit) const {
  return conditions_.contains({name, layout_.unit(unit).id, {}});
}

void Ledger::End(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus) {
  if (conditions_.empty()) return;
  Condition condition{name, {}, bus};
  if (unit) condition.unit = layout_.unit(*unit).id;
  if (conditions_.erase(condition) > 0) Note(AlarmEndRow{name, condition.unit, bus});
  unconfirmed_.erase(condition);
}

// A bus that is up, or DDS that works, is reported by nobody. An alarm of an earlier run about them
// is over where this run does not raise it again.
void Ledger::EndUnconfirmed() {
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
void Ledger::EndOfWhatLeft() {
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

void Ledger::ReplyWhenDurable(std::uint64_t request, std::string text) {
  kept_replies_.push_back({batch_now(), request, std::move(text)});
}

void Ledger::RefuseReplies(std::uint64_t first_batch, std::uint64_t last_batch,
                           const std::string& why) {
  for (KeptReply& kept : kept_replies_)
    if (kept.batch >= first_batch && kept.batch <= last_batch) kept.refused = why;
}

void Ledger::SendReplies() {
  std::vector<ReplyEffect>& replies = step_.out->replies;
  while (!kept_replies_.empty()) {
    KeptReply& kept = kept_replies_.front();
    if (!kept.refused.empty()) {
      replies.push_back(
          {kept.request,
           true,
           Error{ErrorCode::kUnavailable,
                 "effective now, NOT stored: the store refuses it (" + kept.refused + ")"},
           {}});
    } else if (committed_through_ >= kept.batch) {
      replies.push_back({kept.request, true, {}, std::move(kept.text)});
    } else if (store_failing_) {
      replies.push_back(
          {kept.request,
           true,
           Error{ErrorCode::kUnavailable,
                 "effective now, NOT stored: the store cannot be written; it is tried again, but "
                 "lost if the daemon ends before that succeeds"},
           {}});
    } else {
      return;
    }
    kept_replies_.pop_front();
  }
}

void Ledger::EndIntent(SerialNumber serial, IntentEnd end) {
  const auto it = intents.find(serial);
  if (it == intents.end()) return;
  Note(IntentEndRow{it->second.serial, it->second.move, end});
  intents.erase(it);
}

void Ledger::BeginStep(std::uint64_t committed_through, bool store_failing) {
  committed_through_ = committed_through;
  store_failing_ = store_failing;
  if (reserved_by_ == 0) ReserveMoves();
  EndUnconfirmed();
  NoteFolded();
}

void Ledger::CloseBatch() {
  if (!step_.out->rows.empty()) step_.out->batch = next_batch_++;
}

}  // namespace focalfleet
