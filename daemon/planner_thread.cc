#include "daemon/planner_thread.h"

#include <utility>

namespace focalfleet {
namespace {

constexpr std::size_t kJobs = 8;

}  // namespace

Result<std::unique_ptr<PlannerThread>> PlannerThread::Create(Planner planner,
                                                             const EventSignal* done) {
  FOCALFLEET_TRY_ASSIGN(EventSignal wake, EventSignal::Create());
  return std::unique_ptr<PlannerThread>(
      new PlannerThread(std::move(planner), done, std::move(wake)));
}

PlannerThread::PlannerThread(Planner planner, const EventSignal* done, EventSignal wake)
    : planner_(std::move(planner)),
      done_(done),
      wake_(std::move(wake)),
      jobs_(kJobs),
      // A job is only taken while its answer has room, so an answer always has.
      answers_(2 * kJobs),
      thread_([this] { Run(); }) {}

PlannerThread::~PlannerThread() {
  ending_ = true;
  wake_.Raise();
  thread_.join();
}

bool PlannerThread::Submit(PlannerWork* work) {
  if (answers_.size() + jobs_.size() >= kJobs || !jobs_.Push(work)) return false;
  wake_.Raise();
  return true;
}

void PlannerThread::Run() {
  while (!ending_) {
    auto work = jobs_.Pop();
    if (!work) {
      wake_.Wait(std::nullopt);
      continue;
    }
    PlanDone done = planner_(*work);
    [[maybe_unused]] const bool had_room = answers_.Push(&done);
    done_->Raise();
  }
}

}  // namespace focalfleet
