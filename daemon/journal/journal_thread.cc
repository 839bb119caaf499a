#include "daemon/journal/journal_thread.h"

#include <chrono>
#include <utility>

#include "daemon/journal/step_record.h"
#include "daemon/loop/thread_name.h"

namespace focalfleet::journal {
namespace {

/// A killed daemon's journal may lack this much of its end. With half of it a quiet daemon would
/// wake eight times a second for nothing.
constexpr std::chrono::milliseconds kWriteEvery{250};
constexpr std::size_t kWaitingMax = 1 << 16;
/// The busiest quarter of a second of 5000 units at four times their speed took 0.5 MB: so much
/// holds half a minute of it.
constexpr std::size_t kWaitingBytesMax = 64 << 20;
/// The thread is woken early at so much.
constexpr std::size_t kWakeBytes = 4 << 20;
constexpr const char* kRestart =
    "this life can be replayed no more; a restart of the daemon begins another";

}  // namespace

Result<std::unique_ptr<JournalThread>> JournalThread::Create(Options options, LifeRecord life) {
  FOCALFLEET_TRY_ASSIGN(EventSignal wake, EventSignal::Create());
  return std::unique_ptr<JournalThread>(
      new JournalThread(std::move(options), std::move(life), std::move(wake)));
}

JournalThread::JournalThread(Options options, LifeRecord life, EventSignal wake)
    : options_(std::move(options)),
      life_(std::move(life)),
      wake_(std::move(wake)),
      waiting_(kWaitingMax),
      thread_([this] { Run(); }) {}

JournalThread::~JournalThread() {
  ending_ = true;
  wake_.Raise();
  thread_.join();
}

void JournalThread::Take(const Inputs& inputs, const Effects& effects) {
  NumberedRecord record{++steps_, {}};
  if (waiting_bytes_ > kWaitingBytesMax || waiting_.size() == waiting_.capacity()) {
    ++dropped_;
    return;
  }
  record.bytes = RecordOf(inputs, effects);
  const std::size_t bytes = record.bytes.size();
  if (!waiting_.Push(&record)) return;  // cannot be: there is room, and nobody else puts
  const std::size_t before = waiting_bytes_.fetch_add(bytes);
  if (before < kWakeBytes && before + bytes >= kWakeBytes) wake_.Raise();
}

void JournalThread::Run() {
  NameThisThread("journal");
  while (!ending_) {
    WriteWaiting();
    wake_.Wait(kWriteEvery);
  }
  WriteWaiting();
  if (writer_ != nullptr && trouble_.empty()) Note(writer_->End());
}

void JournalThread::WriteWaiting() {
  if (writer_ == nullptr) {
    // Records wait until there is a place for them.
    auto writer = JournalWriter::Open(options_.files, life_);
    if (!writer) return Note(tl::unexpected<Error>(writer.error()));
    writer_ = std::move(*writer);
  }
  std::vector<NumberedRecord> records;
  std::size_t bytes = 0;
  while (bytes < kWaitingBytesMax) {
    auto record = waiting_.Pop();
    if (!record) break;
    bytes += record->bytes.size();
    records.push_back(std::move(*record));
  }
  waiting_bytes_ -= bytes;
  if (!records.empty()) Note(Write(records));
}

Status JournalThread::Write(const std::vector<NumberedRecord>& records) {
  FOCALFLEET_TRY(writer_->Write(records));
  if (dropped_ > 0)
    return Fail(
        ErrorCode::kFull,
        options_.files.folder + ": the disk did not keep up, and steps are missing: " + kRestart);
  if (!writer_->whole())
    return Fail(ErrorCode::kFull,
                options_.files.folder +
                    ": this life is longer than [journal] limit_MiB holds: " + kRestart);
  return {};
}

void JournalThread::Note(const Status& status) {
  const std::string trouble = status ? std::string() : status.error().text;
  if (trouble == trouble_) return;
  trouble_ = trouble;
  options_.tell(trouble);
}

}  // namespace focalfleet::journal
