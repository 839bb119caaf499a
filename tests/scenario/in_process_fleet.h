// The whole fleet in one process and on virtual time: the real coordinator, the real planner, the
// simulated world, and a store in memory that commits after a delay, can fail, and outlives the
// coordinator. What a scenario test drives. The same options and seed give the same run, bit for
// bit.
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "daemon/ports/simulated_port.h"
#include "fleet/coordinator.h"
#include "fleet/layout.h"
#include "protocol/base/rng.h"
#include "sim/world/world.h"
#include "tests/support/memory_store.h"

namespace focalfleet::test {

class InProcessFleet {
 public:
  struct Options {
    std::uint32_t count = 37;
    std::uint32_t units_per_bus = 10;
    std::uint64_t seed = 1;
    DurationNs commit_delay = Milliseconds(5);
    DurationNs plan_delay = Milliseconds(20);
    CoordinatorConfig config;
    sim::Spread spread = sim::Spread::kNominal;
    DurationNs exposure_delay = Milliseconds(500);
    double centroid_sigma_um = 2;
    double clock_error_max = sim::WorldConfig{}.clock_error_max;  // of each unit's clock
    std::uint32_t first_id = 1;
    sim::FactoryDrive factory;  // as the units left it; the coordinator expects the default
    std::vector<sim::PlannedFault> faults = {};
    std::uint8_t sensors = 0;                           // at the joint of each unit
    std::map<std::uint32_t, double> clock_errors = {};  // of single units, by number in the layout
    /// Frames are stamped when the coordinator hears them, as on a socket without stamps of the
    /// kernel; else when they end.
    bool stamped_when_heard = false;
  };

  explicit InProcessFleet(const Options& options);

  /// Virtual time passes; the coordinator steps whenever it has something to do.
  void Run(DurationNs duration);
  /// True as soon as `done` is; false when `limit` has passed.
  bool RunUntil(const std::function<bool()>& done, DurationNs limit);
  /// Until no configuration is under way. Default limit: no configuration of these sizes takes
  /// longer.
  bool RunUntilIdle(DurationNs limit = Seconds(900));

  /// The coordinator stands still (kill -STOP) while the world goes on. What it would have heard
  /// waits for it, or was more than the socket holds and is lost.
  enum class Heard : std::uint8_t { kWaits, kLost };
  void Freeze(DurationNs duration, Heard heard);
  /// A stop of all that somebody else puts on every bus, as `stop --direct` does.
  void StopDirectly();

  /// What the port of a bus tells of its link, beside what it tells of its controller by itself.
  /// Frames pass all the same: only what the coordinator makes of it is tried; KillBus is the other
  /// half.
  void ReportLink(LinkEvent event) { links_.push_back(std::move(event)); }

  /// A frame that no unit sent, heard with the next step.
  void Hear(const ReceivedFrame& frame) { heard_.push_back(frame); }

  void Send(Command command);
  /// Applies a random configuration that is clear of what stands; returns its request number.
  std::uint64_t ApplyRandom(std::uint64_t seed);
  std::uint64_t Apply(std::vector<std::optional<Pose>> targets);
  std::uint64_t ApplyMeasured(std::vector<std::optional<Pose>> targets,
                              const ApplyCommand::Measure& measure);
  /// The same configuration as ApplyRandom's, measured and corrected.
  std::uint64_t ApplyRandomMeasured(std::uint64_t seed, const ApplyCommand::Measure& measure);

  /// kill -9 and a new start: nothing of the coordinator survives but the store; the world goes on.
  void Restart();

  /// SIGTERM: the coordinator's last rows are written.
  void End();

  [[nodiscard]] std::optional<ReplyEffect> LastReply(std::uint64_t request) const;
  /// Fails the running test where a unit's true angle is not where the store says it is.
  void ExpectStoreTellsTheTruth(const std::string& when) const;
  [[nodiscard]] std::uint32_t CountOutcome(TargetOutcome outcome) const;
  [[nodiscard]] std::vector<Pose> TruePoses() const;  // nearest vectors
  [[nodiscard]] UnitId id(std::uint32_t n) const { return layout_->units()[n].id; }

  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] Coordinator& coordinator() { return *coordinator_; }
  [[nodiscard]] sim::World& world() { return *world_; }
  [[nodiscard]] const Layout& layout() const { return *layout_; }
  [[nodiscard]] MemoryStore& store() { return store_; }
  [[nodiscard]] const MemoryStore& store() const { return store_; }
  /// That the coordinator was given last.
  [[nodiscard]] const Plan& last_plan() const { return last_plan_; }
  [[nodiscard]] std::uint64_t digest() const { return digest_; }

  bool store_fails = false;
  /// Rows that the store refuses beside those that it always does.
  std::function<bool(const Row&)> refuse;
  /// Given: for so long the host is held up between a step and sending what came of it.
  std::function<DurationNs()> held_up;
  /// What the camera makes of an exposure before the coordinator hears of it.
  std::function<void(ExposureDone*)> camera_fault;
  /// Answers exposure jobs in the stead of that camera.
  std::function<ExposureDone(const ExposureJob&)> measurer;
  std::vector<sim::WireFrame>* wire = nullptr;  // gets every frame of every bus, where it is set
  std::vector<OutFrame>* sent = nullptr;        // where it is given: all frames of the coordinator

 private:
  void StepOnce();
  void Perform(const Effects& effects);
  [[nodiscard]] ExposureDone Expose(const ExposureJob& job);

  struct Commit {
    HostInstant at;
    std::uint64_t batch;
    std::vector<Row> rows;
  };
  struct Planning {
    HostInstant at;
    PlanJob job;
  };

  Options options_;
  std::unique_ptr<Layout> layout_;
  std::vector<UnitDrive> drives_;
  std::unique_ptr<sim::World> world_;
  std::vector<SimulatedLink> controllers_;  // Shape: as the layout's buses
  std::unique_ptr<Coordinator> coordinator_;
  MemoryStore store_;
  HostInstant now_{Seconds(1).ns};
  HostInstant wake_at_{0};
  HostInstant sync_at_ = kNever;
  std::deque<Commit> commits_;
  std::deque<Planning> planning_;
  struct Exposing {
    HostInstant at;
    ExposureJob job;
  };
  std::deque<Exposing> exposing_;
  Rng camera_noise_{1};
  std::uint64_t committed_through_ = 0;
  std::vector<RefusedRow> refused_;
  std::vector<Command> commands_;
  std::vector<LinkEvent> links_;
  std::vector<ReplyEffect> replies_;
  std::vector<ReceivedFrame> heard_;
  Effects effects_;
  Plan last_plan_;
  std::uint64_t next_request_ = 1;
  std::uint64_t digest_ = 0xcbf29ce484222325u;
};

}  // namespace focalfleet::test
