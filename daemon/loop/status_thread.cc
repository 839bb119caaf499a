#include "daemon/loop/status_thread.h"

#include <chrono>
#include <utility>

#include "daemon/dds/status_publisher.h"
#include "daemon/loop/thread_name.h"

namespace focalfleet {
namespace {

constexpr std::size_t kBatchesWaiting = 4;
constexpr std::chrono::milliseconds kPublishAgain{50};

}  // namespace

Result<std::unique_ptr<StatusThread>> StatusThread::Create(Sinks sinks) {
  FOCALFLEET_TRY_ASSIGN(EventSignal wake, EventSignal::Create());
  return std::unique_ptr<StatusThread>(new StatusThread(std::move(sinks), std::move(wake)));
}

StatusThread::StatusThread(Sinks sinks, EventSignal wake)
    : sinks_(std::move(sinks)),
      wake_(std::move(wake)),
      batches_(kBatchesWaiting),
      thread_([this] { Run(); }) {}

StatusThread::~StatusThread() {
  ending_ = true;
  wake_.Raise();
  thread_.join();
}

bool StatusThread::Publish(StatusBatch* status) {
  if (!batches_.Push(status)) {
    refused_ = true;
    // The thread may have emptied the queue before it could know of the refusal.
    if (!batches_.Push(status)) return false;
  }
  wake_.Raise();
  return true;
}

void StatusThread::Publish(const AlarmValue& alarm) {
  {
    const std::lock_guard lock(lock_);
    alarms_.push_back(alarm);
    if (alarms_.size() > StatusPublisher::kAlarmsKept) alarms_.pop_front();
  }
  wake_.Raise();
}

void StatusThread::Run() {
  NameThisThread("status");
  bool again = false;
  for (;;) {
    sinks_.alive();
    const bool ending = ending_;  // read before the queues: earlier values are seen below
    PublishAlarms();
    auto batch = batches_.Pop();
    if (batch) {
      again = sinks_.publish(*batch);
      if (refused_.exchange(false)) sinks_.room();
      continue;
    }
    if (ending) return;
    if (again) again = sinks_.publish({});
    wake_.Wait(again ? std::optional(kPublishAgain) : std::nullopt);
  }
}

void StatusThread::PublishAlarms() {
  std::deque<AlarmValue> alarms;
  {
    const std::lock_guard lock(lock_);
    alarms.swap(alarms_);
  }
  for (const AlarmValue& alarm : alarms) sinks_.alarm(alarm);
}

}  // namespace focalfleet
