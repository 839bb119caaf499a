// InProcessFleet is the whole fleet in one process and on virtual time; scenario tests drive it.
// The fleet has the real coordinator, the real planner, the simulated world, and a store in memory.
// The store commits after a delay, can fail, and outlives the coordinator. The same options and
// seed give the same run, bit for bit.
#pragma once

#include <cstdint>
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
#include "sim/world/world.h"
#include "tests/scenario/delayed_parts.h"

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
    sim::FactoryDrive factory;  // the units' settings; the coordinator expects the default
    std::vector<sim::PlannedFault> faults = {};
    std::uint8_t sensors = 0;                           // at the joint of each unit
    std::map<std::uint32_t, double> clock_errors = {};  // of single units, by number in the layout
    /// True: frames are stamped when the coordinator hears them, as on a socket without stamps of
    /// the kernel. False: they are stamped when they end.
    bool stamped_when_heard = false;
  };

  explicit InProcessFleet(const Options& options);

  /// Lets virtual time pass; the coordinator steps whenever it has something to do.
  void Run(DurationNs duration);
  /// Runs until `done` is true, and returns true; false when `limit` has passed.
  bool RunUntil(const std::function<bool()>& done, DurationNs limit);
  /// Runs until no configuration is under way. Default limit: no configuration of these sizes takes
  /// longer.
  bool RunUntilIdle(DurationNs limit = Seconds(900));

  /// Stops the coordinator (kill -STOP) while the world goes on. Frames meanwhile wait for it, or
  /// exceed the socket's buffer and are lost.
  enum class Heard : std::uint8_t { kWaits, kLost };
  void Freeze(DurationNs duration, Heard heard);

  /// Reports a state of a bus' link as its port would, in addition to the states of its controller.
  /// Frames pass all the same: the call tests only the coordinator's reaction. KillBus tests the
  /// loss of frames.
  void ReportLink(LinkEvent event) { inputs_.links.push_back(std::move(event)); }

  /// Adds a frame that no unit sent; the coordinator hears it with the next step.
  void Hear(const ReceivedFrame& frame) { inputs_.frames.push_back(frame); }

  void Send(Command command);
  /// Applies a random configuration that is clear of all units that stand; returns its request
  /// number.
  std::uint64_t ApplyRandom(std::uint64_t seed);
  std::uint64_t Apply(std::vector<std::optional<Pose>> targets);
  std::uint64_t ApplyMeasured(std::vector<std::optional<Pose>> targets,
                              const ApplyCommand::Measure& measure);
  /// Applies the same configuration as ApplyRandom, measured and corrected.
  std::uint64_t ApplyRandomMeasured(std::uint64_t seed, const ApplyCommand::Measure& measure);

  /// Kills the coordinator (kill -9) and starts a new one. Nothing of it survives but the store;
  /// the world goes on.
  void Restart();

  /// Ends the coordinator (SIGTERM): its last rows are written.
  void End();

  [[nodiscard]] std::optional<ReplyEffect> LastReply(std::uint64_t request) const;
  [[nodiscard]] UnitId id(std::uint32_t n) const { return layout_->units()[n].id; }

  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] Coordinator& coordinator() { return *coordinator_; }
  [[nodiscard]] sim::World& world() { return *world_; }
  [[nodiscard]] const Layout& layout() const { return *layout_; }
  [[nodiscard]] MemoryStore& store() { return storage.memory(); }
  [[nodiscard]] const MemoryStore& store() const { return storage.memory(); }
  [[nodiscard]] std::uint64_t digest() const { return digest_; }

  DelayedStore storage;
  DelayedPlanner planner;
  DelayedCamera camera;
  /// If set, the delay of the host between a step and sending its results.
  std::function<DurationNs()> held_up;
  std::vector<sim::WireFrame>* wire = nullptr;  // receives every frame of every bus, if set
  std::vector<OutFrame>* sent = nullptr;        // receives all frames of the coordinator, if set

 private:
  void StepOnce();
  void Perform(const Effects& effects);

  /// Inputs of the next step.
  struct Pending {
    std::vector<Command> commands;
    std::vector<LinkEvent> links;
    std::vector<ReceivedFrame> frames;
  };

  Options options_;
  std::unique_ptr<Layout> layout_;
  std::vector<UnitDrive> drives_;
  std::unique_ptr<sim::World> world_;
  std::vector<SimulatedLink> controllers_;  // Shape: as the layout's buses
  std::unique_ptr<Coordinator> coordinator_;
  HostInstant now_{Seconds(1).ns};
  HostInstant wake_at_{0};
  HostInstant sync_at_ = kNever;
  Pending inputs_;
  std::vector<ReplyEffect> replies_;
  Effects effects_;
  std::uint64_t next_request_ = 1;
  std::uint64_t digest_ = 0xcbf29ce484222325u;
};

}  // namespace focalfleet::test
