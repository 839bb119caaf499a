// The shell is one turn of the daemon, apart from all waiting: all inputs that are there go to the
// coordinator in one Step, and then the effects are performed. Rows go to the store's writer and
// frames to the buses. A plan job goes to the planner, an exposure to the camera. Replies go to the
// request handler, status to the scheduler. None of these is waited for.
//
// The event loop (event_loop.h) waits on descriptors and calls Turn. A simulation of the daemon
// calls it on virtual time, and ends a life between any two of its effects.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "daemon/camera/camera_work.h"
#include "daemon/clock/clock.h"
#include "daemon/loop/bus_lines.h"
#include "daemon/loop/job_queue.h"
#include "daemon/loop/sector_port.h"
#include "daemon/loop/service_report.h"
#include "daemon/loop/store_writer.h"
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
  std::uint64_t configuration = 0;  // under way when the job was given
};
using PlannerQueue = JobQueue<PlannerWork, PlanDone>;
using CameraQueue = JobQueue<CameraWork, ExposureDone>;
using ReaderQueue = JobQueue<StoreQuestion, StoreAnswer>;
using StateQueue = JobQueue<StateRows, std::string>;  // the text of `state`

/// Places of a turn between two effects. A simulation of the daemon may end it there.
enum class TurnPoint : std::uint8_t {
  kGathered,    // all inputs are read
  kStepped,     // the coordinator has decided, and nothing is done yet
  kRowsGiven,   // rows are with the writer
  kFramesPut,   // frames wait for their ports
  kJobsGiven,   // plan and exposure are with their queues
  kReplied,     // answers are with the server of lines
  kFlushed,     // ports have taken what they could
  kStatusGiven  // status is with the writer
};
inline constexpr std::size_t kTurnPointCount = 8;

class Shell {
 public:
  /// All parts outlive the shell.
  struct Parts {
    const Layout* layout = nullptr;
    Coordinator* coordinator = nullptr;
    BusLines* lines = nullptr;
    RequestHandler* handler = nullptr;
    ModelRegistry* models = nullptr;  // the model in force
    AlarmRegister* alarms = nullptr;
    AuditTrail* audit = nullptr;
    PlannerQueue* planner = nullptr;
    CameraQueue* camera = nullptr;  // none: neither camera nor sensors
    StoreWriter* store = nullptr;
    ReaderQueue* reader = nullptr;
    StateQueue* states = nullptr;
    StatusScheduler* scheduler = nullptr;  // none: DDS is off
    MetricsSampler* metrics = nullptr;     // none: no metrics are served
    SyncPulse* sync = nullptr;             // none: no SYNC line
    SectorPort* sector = nullptr;          // none: the daemon is no sector of a plane
    DdsTroubles* troubles = nullptr;       // none: no part has troubles to report
    ServiceReport* service = nullptr;      // none: no service manager
    HostClock clock;
    /// Looks, without waiting, which lines and requests are ready.
    std::function<void()> look = [] {};
    std::function<void(TurnPoint)> passed = [](TurnPoint) {};
    /// Receives each step, before anything of it is done.
    std::function<void(const Inputs&, const Effects&)> stepped = [](const Inputs&, const Effects&) {
    };
  };

  explicit Shell(Parts parts);
  Shell(const Shell&) = delete;
  Shell& operator=(const Shell&) = delete;

  /// The server of lines has something to do.
  void MarkRequests() { requests_ready_ = true; }
  /// The instant at which a turn is due though nothing happens; not after the present one where it
  /// is due at once.
  [[nodiscard]] HostInstant wake_at();
  /// Takes in what is there, and performs what follows.
  void Turn();
  /// The last rows are with the writer. No turn follows.
  void End();

  [[nodiscard]] std::uint64_t steps() const { return steps_; }
  [[nodiscard]] FleetView View() const;

 private:
  void Gather();
  [[nodiscard]] bool StepIsDue() const;
  void Step();
  void ServeSync();
  void Perform();
  void SubmitPlan(PlanJob job);
  void PublishStatus();
  void LogChanges();

  Parts parts_;
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
  /// The facts of the store's writer, as the coordinator last received them.
  struct StoreFacts {
    std::uint64_t committed_through = 0;
    bool failing = false;
    bool hangs = false;
  } store_;
  Effects effects_;
  std::uint64_t last_batch_ = 0;
  std::uint64_t steps_ = 0;
};

}  // namespace focalfleet
