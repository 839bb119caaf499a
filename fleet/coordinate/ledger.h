// The ledger is the coordinator's side of the store. Rows and alarms are appended to the effects
// here, and the ledger keeps what the store holds of each serial number. Numbers that no earlier
// run has used are handed out here, too. Replies that promise durability wait here until their
// batch is committed.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "fleet/coordinate/coordinator_config.h"
#include "fleet/coordinate/step_state.h"
#include "fleet/layout.h"
#include "fleet/records.h"

namespace focalfleet {

class Ledger {
 public:
  /// `layout`, `config` and `step` outlive the ledger.
  Ledger(const Layout& layout, const CoordinatorConfig& config, StoredFleet stored,
         const StepState& step);

  template <class AnyRow>
  void Note(AnyRow&& row) {
    step_.out->rows.emplace_back(std::forward<AnyRow>(row));
  }
  /// Notes an alarm, with the severity of its name. The first few of equal ones (of one name, unit
  /// and bus) in quick succession are noted. The others are folded into one later: "n times in m
  /// s".
  void Raise(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus,
             std::string text);
  /// The condition of an alarm has ended, if it was one. Cost: a look-up among lasting conditions.
  void End(AlarmName name, std::optional<PositionerIndex> unit, std::optional<BusId> bus);
  /// Whether the condition of an alarm lasts.
  [[nodiscard]] bool Lasts(AlarmName name, PositionerIndex unit) const;
  /// Replies when this step's rows are durable; at once, with an error, where they cannot be
  /// written.
  void ReplyWhenDurable(std::uint64_t request, std::string text);
  /// Replies that wait for these batches, both included, say instead that the rows are not stored.
  void RefuseReplies(std::uint64_t first_batch, std::uint64_t last_batch, const std::string& why);
  /// Closes the open intent of the serial number, if there is one.
  void EndIntent(SerialNumber serial, IntentEnd end);

  /// The batch number that this step's rows will carry.
  [[nodiscard]] std::uint64_t batch_now() const { return next_batch_; }
  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  [[nodiscard]] bool store_failing() const { return store_failing_; }

  /// A number that no unit holds a move under. Numbers are taken from a stock that the store holds
  /// as used. A run that is killed may leave armed units behind that do not answer, and the start
  /// signals of the next run reach them. Pre: MovesAreReserved().
  MoveId TakeMoveId();
  [[nodiscard]] bool MovesAreReserved() const { return committed_through_ >= reserved_by_; }
  std::uint64_t TakeConfigurationId() { return next_configuration_++; }
  std::uint64_t TakeExposureId() { return next_exposure_++; }

  void BeginStep(std::uint64_t committed_through, bool store_failing);
  /// Notes all folded alarms, since no later step does.
  void NoteAllFolded();
  /// Sends the replies whose rows are durable, or never will be.
  void SendReplies();
  /// Numbers the batch of this step's rows, if there are any.
  void CloseBatch();

  std::unordered_map<SerialNumber, VectorRow> vectors;   // as stored
  std::unordered_map<SerialNumber, IntentRow> intents;   // open ones
  std::vector<ConfigurationRow> earlier_configurations;  // as stored

 private:
  struct KeptReply {
    std::uint64_t batch;
    std::uint64_t request;
    std::string text;
    std::string refused = {};  // why it is not stored, and never will be
  };

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

  void NoteAlarm(const Condition& alarm, std::string text, std::uint32_t times);
  void NoteRepeats(const Condition& alarm, const Repeats& repeats);
  void NoteFolded();
  void ReserveMoves();
  void EndUnconfirmed();
  /// Conditions of units, buses, sensors and a camera that an earlier run had and this one has not
  /// are over.
  void EndOfWhatLeft();

  const Layout& layout_;
  const CoordinatorConfig& config_;
  const StepState& step_;
  std::uint64_t committed_through_ = 0;
  bool store_failing_ = false;
  std::uint64_t next_batch_ = 1;
  std::uint64_t next_configuration_ = 1;
  std::uint64_t next_alarm_ = 1;
  std::uint64_t next_exposure_ = 1;
  std::set<Condition> conditions_;
  std::map<Condition, Repeats> repeats_;
  HostInstant fold_at_ = kNever;  // NoteFolded has something to do then
  // Conditions of the host that an earlier run has left, until `confirm_until_`.
  std::set<Condition> unconfirmed_;
  HostInstant confirm_until_ = kNever;
  MoveId next_move_;
  std::uint32_t moves_left_ = 0;
  std::uint64_t reserved_by_ = 0;  // the batch of the first stock
  std::deque<KeptReply> kept_replies_;
};

}  // namespace focalfleet
