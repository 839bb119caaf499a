#include "daemon/loop/store_writer.h"

#include <algorithm>
#include <iterator>
#include <utility>
#include <variant>

#include "daemon/loop/row_bytes.h"
#include "fleet/row_check.h"
#include "protocol/base/limits.h"

namespace focalfleet {
namespace {

constexpr std::size_t kBatches = 1024;
constexpr std::size_t kStatuses = 4;
constexpr std::size_t kRowsPerTransaction = 65'536;
/// At the end the publisher may be behind, and nothing else wakes the thread. The wait is a tenth
/// of what a slow cycle of DDS takes.
constexpr std::chrono::milliseconds kOfferAgain{20};
/// In half a second even a slow cycle is over. Twice as many would take the time in which the
/// daemon must have ended.
constexpr int kOffersAtEnd = 25;
/// Alarms of the writer itself are numbered apart from the stored ones: the store fails, so these
/// alarms are not stored.
constexpr std::uint64_t kOwnAlarms = std::uint64_t{1} << 63;

std::int64_t NsOf(std::chrono::milliseconds time) { return std::chrono::nanoseconds(time).count(); }

}  // namespace

StoreWriter::StoreWriter(Sinks sinks)
    : sinks_(std::move(sinks)), batches_(kBatches), statuses_(kStatuses) {}

// ---- called by the core

void StoreWriter::Commit(std::uint64_t batch, std::vector<Row> rows) {
  const std::size_t bytes = BytesOf(rows);
  bytes_waiting_ += bytes;
  held_.push_back({batch, batch, std::move(rows), sinks_.wall(), bytes});
  HandOver();
}

Status StoreWriter::RoomForRows() const {
  constexpr std::size_t kMiB = std::size_t{1} << 20;
  const std::size_t bytes = bytes_waiting_;
  if (bytes <= limits::kRowBytesWaiting) return {};
  const auto why = failure();
  return Fail(ErrorCode::kUnavailable, "it cannot be stored: " + std::to_string(bytes / kMiB) +
                                           " MiB of rows wait for the store already, at most " +
                                           std::to_string(limits::kRowBytesWaiting / kMiB) +
                                           " may" + (why ? " (" + why->text + ")" : "") +
                                           "; nothing was changed");
}

void StoreWriter::HandOver() {
  bool any = false;
  while (!held_.empty() && batches_.Push(&held_.front())) {
    held_.pop_front();
    any = true;
  }
  if (any) sinks_.offered();
}

bool StoreWriter::Publish(StatusBatch* status) {
  if (!statuses_.Push(status)) return false;
  sinks_.offered();
  return true;
}

std::vector<RefusedRow> StoreWriter::TakeRefused() {
  const std::lock_guard lock(lock_);
  return std::exchange(refused_, {});
}

std::optional<Error> StoreWriter::failure() const {
  if (hangs()) return Error{ErrorCode::kUnavailable, kNoAnswer};
  const std::lock_guard lock(lock_);
  return failing_ ? std::optional(last_error_) : std::nullopt;
}

/// From here on in_disk() answers for the thread. A question that came just before has its answer,
/// too.
void StoreWriter::EnterDisk() {
  call_began_ns_ = sinks_.monotonic_ns();
  sinks_.alive();
}

bool StoreWriter::hangs() const {
  const std::int64_t began_ns = call_began_ns_;
  return began_ns != kNoCall && sinks_.monotonic_ns() - began_ns >= NsOf(sinks_.hangs_after);
}

// ---- turns

StoreWriter::Rest StoreWriter::Turn(bool ending) {
  constexpr std::chrono::milliseconds kAtOnce{0};
  sinks_.alive();
  Gather();
  const bool committed = TryCommit(ending);
  PublishReady(ending);
  if (committed && batches_.size() > 0) return {.wait = kAtOnce};
  if (ending && (Idle() || failing_)) return {.ended = true};
  if (committed && !ending && KeepUp()) return {.wait = kAtOnce};
  if (!attempted_) return {.wait = ending ? std::optional(kOfferAgain) : std::nullopt};
  const std::chrono::nanoseconds left(retry_at_ns_ - sinks_.monotonic_ns());
  return {.wait = std::clamp(std::chrono::ceil<std::chrono::milliseconds>(left),
                             std::chrono::milliseconds(1), sinks_.retry_period)};
}

bool StoreWriter::Idle() const {
  return open_.rows.empty() && batches_.size() == 0 && statuses_.size() == 0 && !status_;
}

/// Adds waiting batches to the open one, unless that has failed already: then it must stay the
/// same.
void StoreWriter::Gather() {
  while (!attempted_ && open_.rows.size() < kRowsPerTransaction) {
    auto next = batches_.Pop();
    if (!next) return;
    if (open_.rows.empty()) {
      open_ = std::move(*next);
      continue;
    }
    open_.number = next->number;
    open_.bytes += next->bytes;
    open_.rows.insert(open_.rows.end(), std::make_move_iterator(next->rows.begin()),
                      std::make_move_iterator(next->rows.end()));
  }
}

bool StoreWriter::TryCommit(bool ending) {
  if (open_.rows.empty()) return true;
  if (attempted_ && !ending && sinks_.monotonic_ns() < retry_at_ns_) return false;
  for (std::size_t k = open_.rows.size(); k-- > 0;)
    if (const char* const flaw = Flaw(open_.rows[k])) SetAside(k, flaw);
  while (!open_.rows.empty()) {
    std::size_t refused = open_.rows.size();
    EnterDisk();
    const Status done = sinks_.commit(open_.rows, open_.at, &refused);
    call_began_ns_ = kNoCall;
    if (done) break;
    const bool for_ever = done.error().code == ErrorCode::kInvalid && refused < open_.rows.size();
    if (!for_ever) {
      NoteFailure(done.error());
      return false;
    }
    SetAside(refused, done.error().text);
  }
  for (const Row& row : open_.rows)
    if (const auto* alarm = std::get_if<AlarmRow>(&row)) sinks_.alarm({open_.at, *alarm});
  open_.rows.clear();
  bytes_waiting_ -= std::exchange(open_.bytes, 0);
  attempted_ = false;
  committed_through_ = open_.number;
  if (failing_.exchange(false) && sinks_.log_info)
    sinks_.log_info("the store can be written again");
  sinks_.progressed();
  return true;
}

/// The rest of the batch goes on without the row, which is in refused_ before committed_through_
/// reaches its batch.
void StoreWriter::SetAside(std::size_t row, const std::string& why) {
  const auto at = open_.rows.begin() + static_cast<std::ptrdiff_t>(row);
  sinks_.log_error("the store refuses the " + Describe(*at) + ": " + why + "; it is set aside");
  {
    const std::lock_guard lock(lock_);
    refused_.push_back({open_.first, open_.number, std::move(*at), why});
  }
  open_.rows.erase(at);
}

void StoreWriter::NoteFailure(const Error& error) {
  {
    const std::lock_guard lock(lock_);
    last_error_ = error;
  }
  attempted_ = true;
  retry_at_ns_ = sinks_.monotonic_ns() + NsOf(sinks_.retry_period);
  if (failing_.exchange(true)) return;
  const std::string text = "the store cannot be written, nothing new is started: " + error.text;
  sinks_.log_error(text);
  // The number contains the time, so that a restarted daemon does not reuse it.
  const WallTime now = sinks_.wall();
  const std::uint64_t id = kOwnAlarms + static_cast<std::uint64_t>(now.ns) / 1000 + own_alarms_++;
  const bool full = error.code == ErrorCode::kFull;
  sinks_.alarm({now,
                {.id = id,
                 .severity = Severity::kError,
                 .unit = {},
                 .bus = {},
                 .text = text,
                 .name = full ? AlarmName::kStoreFull : AlarmName::kStoreFailing}});
  sinks_.progressed();
}

/// True: more is due at once.
bool StoreWriter::KeepUp() {
  const std::int64_t now_ns = sinks_.monotonic_ns();
  if (now_ns < upkeep_at_ns_) return false;
  EnterDisk();
  const bool more = sinks_.upkeep();
  call_began_ns_ = kNoCall;
  upkeep_at_ns_ = more ? now_ns : now_ns + NsOf(sinks_.upkeep_period);
  return more;
}

void StoreWriter::PublishReady(bool ending) {
  for (;;) {
    if (!status_) status_ = statuses_.Pop();
    if (!status_) return;
    if (committed_through_ < status_->after_batch) {
      // The fleet's own status says that the store fails; it alone may go ahead of the commit.
      if (failing_ && status_->fleet) {
        StatusBatch ahead;
        ahead.fleet = std::move(status_->fleet);
        ahead.fleet->store_failing = true;
        status_->fleet.reset();
        static_cast<void>(sinks_.publish(&ahead));  // the next one says the same
      }
      return;
    }
    if (!sinks_.publish(&*status_)) {
      if (!ending || ++offered_at_end_ < kOffersAtEnd) return;  // else DDS hangs
    }
    status_.reset();
  }
}

}  // namespace focalfleet
