#include "fleet/coordinate/ledger.h"

#include <utility>

#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

MoveId MoveAfter(MoveId move, std::uint32_t count) {
  constexpr std::uint32_t kIds = 65'535;  // 0 is none
  return {static_cast<std::uint16_t>((move.value + count - 1) % kIds + 1)};
}

}  // namespace

Ledger::Ledger(const Layout& layout, const CoordinatorConfig& config, StoredFleet stored,
               const StepState& step)
    : earlier_configurations(std::move(stored.configurations)),
      step_(step),
      alarms_(layout, config, stored, step),
      next_configuration_(stored.next_configuration),
      first_configuration_(stored.next_configuration),
      next_exposure_(stored.next_exposure),
      next_move_(stored.next_move) {
  for (const auto& row : stored.vectors) vectors[row.serial] = row;
  for (const auto& row : stored.open_intents) intents[row.serial] = row;
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
  ended_by_[serial] = batch_now();
}

std::uint64_t Ledger::BatchOfEnd(SerialNumber serial) const {
  if (intents.contains(serial)) return kOpen;
  const auto ended = ended_by_.find(serial);
  return ended == ended_by_.end() ? 0 : ended->second;
}

void Ledger::BeginStep(std::uint64_t committed_through, bool store_failing) {
  committed_through_ = committed_through;
  store_failing_ = store_failing;
  if (reserved_by_ == 0) ReserveMoves();
  alarms_.BeginStep();
}

void Ledger::CloseBatch() {
  if (!step_.out->rows.empty()) step_.out->batch = next_batch_++;
}

}  // namespace focalfleet
