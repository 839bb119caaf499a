// Planning takes up to seconds, a bus wants its answer in milliseconds: plans are made on a thread
// of their own, one after the other. The job carries all that it needs as values; the answer comes
// back through a queue.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "daemon/event_signal.h"
#include "daemon/spsc_queue.h"
#include "fleet/coordinator.h"

namespace focalfleet {

struct PlannerWork {
  PlanJob job;
  std::vector<UnitDrive> drives;
};

class PlannerThread {
 public:
  using Planner = std::function<PlanDone(const PlannerWork&)>;  // RunPlanJob

  /// `done` is raised when a plan is ready; it outlives the thread. Errors: kUnavailable: no
  /// descriptors left.
  static Result<std::unique_ptr<PlannerThread>> Create(Planner planner, const EventSignal* done);
  PlannerThread(const PlannerThread&) = delete;
  PlannerThread& operator=(const PlannerThread&) = delete;
  /// Waits for the plan that is being made.
  ~PlannerThread();

  /// False: too many jobs wait (the coordinator has one at a time); `work` is untouched.
  [[nodiscard]] bool Submit(PlannerWork* work);
  std::optional<PlanDone> Take() { return answers_.Pop(); }

 private:
  PlannerThread(Planner planner, const EventSignal* done, EventSignal wake);
  void Run();

  Planner planner_;
  const EventSignal* done_;
  EventSignal wake_;
  SpscQueue<PlannerWork> jobs_;
  SpscQueue<PlanDone> answers_;
  std::atomic<bool> ending_{false};
  std::thread thread_;
};

}  // namespace focalfleet
