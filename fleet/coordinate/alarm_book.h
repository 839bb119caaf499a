// Alarms, and the conditions that are behind some of them. Equal alarms (of one name, unit and bus)
// in quick succession are folded: the first few are noted, and the others become one, later: "n
// times more in m s". A condition lasts from its alarm to its end, also over a restart.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/step_state.h"
#include "fleet/layout.h"
#include "fleet/records.h"

namespace focalfleet {

class AlarmBook {
 public:
  /// `layout`, `config` and `step` outlive the book.
  AlarmBook(const Layout& layout, const CoordinatorConfig& config, const StoredFleet& stored,
            const StepState& step);

  void BeginStep();
  /// Notes an alarm, now or folded into a later one, with the severity of its name.
  void Raise(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus,
             std::string text);
  /// The alarm of a condition that lasts has a better text now. The text is noted without counting
  /// the alarm again; a folded one takes it along.
  void Explain(AlarmName name, PositionerIndex unit, std::string text);
  /// The condition of an alarm has ended, if it was one. Cost: a look-up among lasting conditions.
  void End(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus);
  /// Whether the condition of an alarm lasts.
  [[nodiscard]] bool Lasts(AlarmName name, PositionerIndex unit) const;
  /// Notes all folded alarms, since no later step does.
  void NoteAllFolded();

 private:
  /// A condition that lasts, from its alarm to its end.
  struct Condition {
    AlarmName name = AlarmName::kUnnamed;
    std::optional<UnitId> unit;
    std::optional<BusId> bus;
    auto operator<=>(const Condition&) const = default;
  };

  /// Equal alarms of the last while.
  struct Repeats {
    HostInstant since;  // the first of the window
    HostInstant begun;  // the newest that was no repetition of a condition that lasts
    HostInstant last;   // the newest
    std::uint32_t noted = 0;
    std::uint32_t folded = 0;
    std::string text = {};  // of the newest that was folded
    bool alike = true;      // whether all that were folded have that text
  };

  template <class AnyRow>
  void Note(AnyRow&& row) {
    step_.out->rows.emplace_back(std::forward<AnyRow>(row));
  }
  void NoteAlarm(const Condition& alarm, std::string text, std::uint32_t times);
  void NoteRepeats(const Condition& alarm, const Repeats& repeats);
  void NoteFolded();
  void EndUnconfirmed();
  /// Conditions of units, buses, sensors and a camera that an earlier run had and this one has not
  /// are over.
  void EndOfWhatLeft();

  const Layout& layout_;
  const CoordinatorConfig& config_;
  const StepState& step_;
  std::uint64_t next_alarm_ = 1;
  std::set<Condition> conditions_;
  std::map<Condition, Repeats> repeats_;
  HostInstant fold_at_ = kNever;  // NoteFolded has something to do then
  // Conditions of the host that an earlier run has left, until `confirm_until_`.
  std::set<Condition> unconfirmed_;
  HostInstant confirm_until_ = kNever;
};

}  // namespace focalfleet
