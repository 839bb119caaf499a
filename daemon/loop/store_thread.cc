#include "daemon/loop/store_thread.h"

#include <utility>

#include "daemon/loop/thread_name.h"

namespace focalfleet {

Result<std::unique_ptr<StoreThread>> StoreThread::Create(Sinks sinks,
                                                         const EventSignal* progressed) {
  FOCALFLEET_TRY_ASSIGN(EventSignal wake, EventSignal::Create());
  return std::unique_ptr<StoreThread>(
      new StoreThread(std::move(sinks), progressed, std::move(wake)));
}

StoreThread::StoreThread(Sinks sinks, const EventSignal* progressed, EventSignal wake)
    : wake_(std::move(wake)),
      writer_(Hooked(std::move(sinks), progressed)),
      thread_([this] { Run(); }) {}

StoreWriter::Sinks StoreThread::Hooked(Sinks sinks, const EventSignal* progressed) {
  sinks.progressed = [progressed] { progressed->Raise(); };
  sinks.offered = [this] { wake_.Raise(); };
  return sinks;
}

StoreThread::~StoreThread() {
  if (!thread_.joinable()) return;
  static_cast<void>(Finish());
  if (thread_.joinable()) thread_.join();
}

Status StoreThread::Finish() {
  constexpr std::chrono::milliseconds kLook{1};  // between looks: a commit takes longer
  while (!ended_) {
    if (writer_.hangs()) return Fail(ErrorCode::kUnavailable, StoreWriter::kNoAnswer);
    if (writer_.held() > 0 && !writer_.failing()) {
      writer_.HandOver();
    } else if (!ending_.exchange(true)) {  // not before: a thread that has nothing left ends
      wake_.Raise();
    }
    std::this_thread::sleep_for(kLook);
  }
  thread_.join();
  const auto failure = writer_.failure();
  if (!failure && writer_.held() == 0) return {};
  return tl::unexpected<Error>(failure.value_or(Error{}));
}

void StoreThread::Run() {
  NameThisThread("store");
  for (;;) {
    const StoreWriter::Rest rest = writer_.Turn(ending_);
    if (rest.ended) {
      ended_ = true;
      return;
    }
    if (rest.wait != std::chrono::milliseconds(0)) wake_.Wait(rest.wait);
  }
}

}  // namespace focalfleet
