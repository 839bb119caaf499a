// The ledger is the coordinator's side of the store. Rows are appended to the effects
// here, and the ledger keeps what the store holds of each serial number. Numbers that no earlier
// run has used are handed out here, too. Replies that promise durability wait here until their
// batch is committed.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <set>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "fleet/coordinate/alarm_book.h"
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
  /// Alarms and the conditions behind them.
  [[nodiscard]] AlarmBook& alarms() { return alarms_; }
  [[nodiscard]] const AlarmBook& alarms() const { return alarms_; }
  /// Replies when this step's rows are durable; at once, with an error, where they cannot be
  /// written.
  void ReplyWhenDurable(std::uint64_t request, std::string text);
  /// Replies that wait for these batches, both included, say instead that the rows are not stored.
  void RefuseReplies(std::uint64_t first_batch, std::uint64_t last_batch, const std::string& why);
  /// Closes the open intent of the serial number, if there is one.
  void EndIntent(SerialNumber serial, IntentEnd end);

  /// The batch that has the end of the last move of the serial number; 0: none of this run. kOpen
  /// while it has an open move.
  static constexpr std::uint64_t kOpen = UINT64_MAX;
  [[nodiscard]] std::uint64_t BatchOfEnd(SerialNumber serial) const;
  /// Whether the end of its last move is stored, or was set aside for good. The next run would need
  /// the unit's own memory of a restart until then.
  [[nodiscard]] bool HasEnd(SerialNumber serial) const {
    return committed_through_ >= BatchOfEnd(serial);
  }

  /// The batch number that this step's rows will carry.
  [[nodiscard]] std::uint64_t batch_now() const { return next_batch_; }
  [[nodiscard]] std::uint64_t committed_through() const { return committed_through_; }
  [[nodiscard]] bool store_failing() const { return store_failing_; }

  /// A number that no unit holds a move under. Numbers are taken from a stock that the store holds
  /// as used. A run that is killed may leave armed units behind that do not answer, and the start
  /// signals of the next run reach them. Pre: MovesAreReserved().
  MoveId TakeMoveId();
  [[nodiscard]] MoveId next_move() const { return next_move_; }
  [[nodiscard]] bool MovesAreReserved() const { return committed_through_ >= reserved_by_; }
  std::uint64_t TakeConfigurationId() { return next_configuration_++; }
  /// The intent was made since this daemon started.
  [[nodiscard]] bool IsOfThisRun(const IntentRow& intent) const {
    return intent.configuration >= first_configuration_;
  }
  std::uint64_t TakeExposureId() { return next_exposure_++; }

  void BeginStep(std::uint64_t committed_through, bool store_failing);
  /// Sends the replies whose rows are durable, or never will be.
  void SendReplies();
  /// Numbers the batch of this step's rows, if there are any.
  void CloseBatch();

  std::unordered_map<SerialNumber, VectorRow> vectors;   // as stored
  std::unordered_map<SerialNumber, IntentRow> intents;   // open ones
  std::vector<ConfigurationRow> earlier_configurations;  // as stored
  std::set<std::uint64_t> homing_configurations;         // of this run, those that homed units

 private:
  struct KeptReply {
    std::uint64_t batch;
    std::uint64_t request;
    std::string text;
    std::string refused = {};  // why it is not stored, and never will be
  };

  void ReserveMoves();

  const StepState& step_;
  AlarmBook alarms_;
  std::uint64_t committed_through_ = 0;
  bool store_failing_ = false;
  std::uint64_t next_batch_ = 1;
  std::uint64_t next_configuration_ = 1;
  std::uint64_t first_configuration_ = 1;  // of this run
  std::uint64_t next_exposure_ = 1;
  MoveId next_move_;
  std::uint32_t moves_left_ = 0;
  std::uint64_t reserved_by_ = 0;  // the batch of the first stock
  std::deque<KeptReply> kept_replies_;
  std::unordered_map<SerialNumber, std::uint64_t> ended_by_;  // batches
};

}  // namespace focalfleet
