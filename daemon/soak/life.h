// A life is the daemon from its start to its kill: the same parts as the process has, without its
// threads and system calls. All waiting is outside; wake_at says until when.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "daemon/loop/shell.h"
#include "daemon/soak/fault_sites.h"
#include "daemon/soak/line_hall.h"
#include "daemon/soak/memory_disk.h"
#include "daemon/soak/night_camera.h"
#include "daemon/soak/plant.h"
#include "daemon/soak/timed_queue.h"
#include "daemon/store/store.h"

namespace focalfleet::soak {

/// Thrown where a life ends in the middle of something.
struct Killed {
  FaultSite site{};
};

/// Everything around a life. All functions may be called at any time of it.
struct Surroundings {
  Plant* plant = nullptr;
  MemoryDisk* disk = nullptr;
  std::function<void(TurnPoint)> passed;
  PlantPort::Hooks port;
  std::function<DurationNs()> commit_takes;
  std::function<DurationNs()> plan_takes;
  std::function<bool()> planner_fails;
  PowerLimits plan_limits;
  std::uint32_t keep_days = 0;  // of history; 0: all
  std::function<bool()> planner_has_room;
  std::function<bool()> reader_fails;
  std::function<bool()> publisher_has_room;
  std::function<bool(ClientId, std::string_view, bool last)> out;
  /// Before and after a commit; `done`: it is acknowledged.
  std::function<void(std::span<const Row>)> commits;
  std::function<void(std::span<const Row>, bool done)> committed;
  std::function<void(const StatusBatch&)> published;
  std::function<void(const std::string&)> log;
  /// The coordinator of this life starts from this state.
  std::function<void(const StoredFleet&, const CoordinatorConfig&)> starts;
  std::function<void(const Inputs&, const Effects&)> stepped;
  /// None: there is no camera.
  std::function<std::unique_ptr<NightCamera>()> camera;
};

class Life {
 public:
  /// Errors: those of the store; a later start may succeed.
  static Result<std::unique_ptr<Life>> Start(const Surroundings& around);
  Life(const Life&) = delete;
  Life& operator=(const Life&) = delete;

  void Put(ClientId client, std::string line) { hall_->Put(client, std::move(line)); }
  /// The instant at which it has something to do.
  [[nodiscard]] HostInstant wake_at();
  /// Does what is due.
  void Turn();
  /// Ends as on SIGTERM. True: all is stored.
  bool End();

  [[nodiscard]] const Coordinator& coordinator() const { return *coordinator_; }
  [[nodiscard]] const StoreWriter& writer() const { return *writer_; }
  [[nodiscard]] const BusLines& lines() const { return *lines_; }
  [[nodiscard]] std::uint64_t steps() const { return shell_->steps(); }

 private:
  explicit Life(const Surroundings& around);
  Status Open();
  [[nodiscard]] StoreWriter::Sinks MakeSinks(std::function<bool()> prune);
  void MakeQueues();
  void MakeShell();
  ShellFacts Facts() const;

  Surroundings around_;
  HostClock clock_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<StoreWriter> writer_;
  HostInstant writer_due_ = kNever;
  bool progressed_ = true;
  std::unique_ptr<Coordinator> coordinator_;
  std::unique_ptr<BusLines> lines_;
  std::unique_ptr<ModelRegistry> models_;
  AlarmRegister alarms_;
  AuditTrail audit_{"soak"};
  LineHall* hall_ = nullptr;  // of the handler
  std::unique_ptr<RequestHandler> handler_;
  std::unique_ptr<StatusScheduler> scheduler_;
  std::unique_ptr<TimedQueue<PlannerWork, PlanDone>> planner_;
  std::unique_ptr<TimedQueue<StoreQuestion, StoreAnswer>> reader_;
  std::unique_ptr<TimedQueue<StateRows, std::string>> states_;
  std::unique_ptr<NightCamera> camera_;
  std::unique_ptr<Shell> shell_;
};

}  // namespace focalfleet::soak
