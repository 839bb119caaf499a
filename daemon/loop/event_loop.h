// The core thread. Each turn of its loop waits until an input is there (frames, requests, a plan, a
// commit, a signal) or a time is due. All inputs go to the coordinator in one Step. Then the loop
// performs the effects. Rows go to the store's thread and frames to the buses. A plan job goes to
// the planner's thread, an exposure to the camera's. Replies go to the request handler, status to
// the scheduler. The loop never waits for any of these.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "daemon/camera/camera_work.h"
#include "daemon/clock/clock.h"
#include "daemon/loop/bus_lines.h"
#include "daemon/loop/event_signal.h"
#include "daemon/loop/job_thread.h"
#include "daemon/loop/service_report.h"
#include "daemon/loop/store_thread.h"
#include "daemon/loop/sync_pulse.h"
#include "daemon/metrics/metrics_sampler.h"
#include "daemon/status/dds_troubles.h"
#include "daemon/status/status_scheduler.h"
#include "daemon/verbs/alarm_register.h"
#include "daemon/verbs/audit_trail.h"
#include "daemon/verbs/model_registry.h"
#include "daemon/verbs/request_handler.h"
#include "fleet/coordinator.h"

namespace focalfleet {

struct PlannerWork {
  PlanJob job;
  std::vector<UnitDrive> drives;
  /// A preview alone has it: true once a configuration is to be planned first.
  std::shared_ptr<const std::atomic<bool>> given_up = nullptr;
};
using PlannerThread = JobThread<PlannerWork, PlanDone>;
using CameraThread = JobThread<CameraWork, ExposureDone>;
using ReaderThread = JobThread<StoreQuestion, StoreAnswer>;

class EventLoop {
 public:
  /// All parts outlive the loop.
  struct Parts {
    const Layout* layout = nullptr;
    Coordinator* coordinator = nullptr;
    BusLines* lines = nullptr;
    RequestHandler* handler = nullptr;
    ModelRegistry* models = nullptr;  // the model in force
    AlarmRegister* alarms = nullptr;
    AuditTrail* audit = nullptr;
    PlannerThread* planner = nullptr;
    CameraThread* camera = nullptr;  // none: neither camera nor sensors
    StoreThread* store = nullptr;
    ReaderThread* reader = nullptr;
    StatusScheduler* scheduler = nullptr;  // none: DDS is off
    MetricsSampler* metrics = nullptr;     // none: no metrics are served
    SyncPulse* sync = nullptr;             // none: no SYNC line
    DdsTroubles* troubles = nullptr;       // none: no part has troubles to report
    const EventSignal* threads = nullptr;  // raised by planner, camera, store, reader
    ServiceReport* service = nullptr;
    std::function<void()> hang_up;  // what SIGHUP asks for: the log is opened anew
    HostClock clock;
  };

  /// SIGTERM, SIGINT and SIGHUP come as data from now on. Pre: no other thread runs yet.
  static void BlockSignals();

  /// Errors: kUnavailable: no descriptors left.
  static Result<std::unique_ptr<EventLoop>> Create(const Parts& parts);
  EventLoop(const EventLoop&) = delete;
  EventLoop& operator=(const EventLoop&) = delete;
  ~EventLoop();

  /// The loop ran until SIGTERM or SIGINT came; the last rows are with the store's thread.
  void Run();

  [[nodiscard]] std::uint64_t steps() const { return steps_; }

 private:
  explicit EventLoop(const Parts& parts) : parts_(parts) {}
  Status Open();
  Status Watch(int fd, std::uint64_t what);
  void Wait();
  void ArmTimer(HostInstant at);
  void DispatchReady(int timeout_ms);
  void Dispatch(std::uint64_t what);
  void ReadSignals();
  void Gather();
  [[nodiscard]] bool StepIsDue() const;
  void Step();
  void ServeSync();
  void Perform();
  void SubmitPlan(PlanJob job);
  void PublishStatus();
  void LogChanges();
  [[nodiscard]] FleetView View() const;

  Parts parts_;
  int epoll_ = -1;
  int timer_ = -1;
  int signals_ = -1;
  std::int64_t timer_set_ns_ = 0;
  bool stopping_ = false;
  bool requests_ready_ = false;

  HostInstant now_;
  std::vector<ReceivedFrame> frames_;
  std::vector<LinkEvent> links_;
  std::vector<Command> commands_;
  std::vector<PlanDone> plans_;
  std::vector<ExposureDone> exposures_;
  // Answers for jobs that found no room.
  std::vector<PlanDone> not_done_plans_;
  std::vector<ExposureDone> not_done_exposures_;
  std::vector<ShellNote> notes_;
  std::shared_ptr<std::atomic<bool>> preview_given_up_;
  /// The facts of the store's thread, as the coordinator last received them.
  struct StoreFacts {
    std::uint64_t committed_through = 0;
    bool failing = false;
  } store_;
  Effects effects_;
  std::uint64_t last_batch_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace focalfleet
