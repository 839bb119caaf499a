// A whole plane in one process and on virtual time: the coordinators of the plane, a real
// coordinator and agent for each sector with a store of its own, the real planner, and one
// simulated fleet on all buses. Each host has its own clock, which is ahead and drifts. Nodes may
// be killed and started again; nothing of them survives but their stores. The same seed gives the
// same run.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "daemon/ports/simulated_port.h"
#include "fleet/coordinator.h"
#include "fleet/plane/plane_coordinator.h"
#include "fleet/plane/sector_agent.h"
#include "sim/world/world.h"
#include "tests/scenario/delayed_parts.h"
#include "tests/scenario/plane_network.h"

namespace focalfleet::test {

class PlaneInProcess {
 public:
  struct Options {
    std::uint32_t sectors = 3;
    std::uint32_t units_per_sector = 8;
    std::uint64_t seed = 1;
    DurationNs clock_ahead_most = Seconds(100);  // of each host's clock, drawn evenly
    double drift_most = 40e-6;
    DurationNs commit_delay = Milliseconds(5);
    DurationNs plan_delay = Milliseconds(100);
    DelayedCamera::Options camera{.delay = Milliseconds(500)};  // of each coordinator
    PlaneTimes times;
    SectorAgentConfig agent;
    sim::Spread spread = sim::Spread::kNominal;
  };
  /// Nodes of the network: sectors from 0 on, then the coordinators.
  struct Sector {
    std::unique_ptr<Layout> layout;
    std::vector<UnitDrive> drives;
    DelayedStore storage{Milliseconds(5)};
    DurationNs ahead;
    double drift = 0;
    PlaneEpoch kept;                 // durable
    std::optional<PlaneEpoch> keep;  // not yet
    HostInstant keep_at = kNever;
    std::uint64_t life = 0;
    std::unique_ptr<Coordinator> coordinator;  // null: it is dead
    std::unique_ptr<SectorAgent> agent;
    Effects last;  // of the coordinator, for the agent
    HostInstant wake{0};
    std::vector<PlaneOrder> orders;
    std::vector<BorderNews> news;
    std::vector<ReceivedFrame> frames;
    std::vector<Command> commands;
    std::vector<SimulatedLink> controllers;
    std::vector<ShellNote> notes;  // all
  };
  struct Plane {
    PlaneRecord kept;
    std::optional<PlaneRecord> keep;
    std::uint64_t keep_number = 0;
    std::uint64_t kept_number = 0;
    HostInstant keep_at = kNever;
    DurationNs ahead;
    std::unique_ptr<PlaneCoordinator> coordinator;  // null: it is dead
    HostInstant wake{0};
    std::vector<SectorReport> reports;
    std::vector<PlaneCommand> commands;
    std::optional<PlaneJob> job;
    HostInstant job_due = kNever;
    std::function<void(PlanePlanDone*)> plan_fault;  // may change a plan
    DelayedCamera camera{{}};
    std::vector<ReplyEffect> replies;  // all
    std::vector<std::string> log;      // all
    std::vector<ShellNote> notes;      // all
  };

  explicit PlaneInProcess(const Options& options);

  void Run(DurationNs duration);
  bool RunUntil(const std::function<bool()>& done, DurationNs limit);

  void KillSector(std::uint32_t sector);
  void StartSector(std::uint32_t sector);
  void KillPlane(std::uint32_t which = 0);
  /// `forget`: the host is another one, without the store.
  void StartPlane(std::uint32_t which = 0, bool forget = false);
  std::uint64_t Apply(std::vector<std::optional<Pose>> targets, std::uint32_t which = 0);
  std::uint64_t Give(decltype(PlaneCommand::what) what, std::uint32_t which = 0);
  /// The last reply to a request; null: none yet.
  [[nodiscard]] const ReplyEffect* ReplyTo(std::uint64_t request, std::uint32_t which = 0) const;
  [[nodiscard]] std::vector<std::optional<Pose>> DrawTargets(std::uint64_t seed) const;
  void Stop(std::uint32_t which = 0);

  [[nodiscard]] PlaneCoordinator& plane(std::uint32_t which = 0) {
    return *planes[which].coordinator;
  }
  [[nodiscard]] bool IsIdle(std::uint32_t which = 0) const {
    const Plane& at = planes[which];
    return at.coordinator != nullptr && at.commands.empty() &&
           at.coordinator->view().phase == PlanePhase::kIdle;
  }
  [[nodiscard]] HostInstant now() const { return now_; }
  [[nodiscard]] const PlaneLayout& layout() const { return *layout_; }
  [[nodiscard]] sim::World& world() { return *world_; }
  [[nodiscard]] const UnitView& unit(PositionerIndex i) const {
    return sectors[layout_->SectorOf(i)].coordinator->unit(layout_->Local(i));
  }
  [[nodiscard]] std::uint32_t Node(std::uint32_t plane_index) const {
    return layout_->sectors() + plane_index;
  }
  [[nodiscard]] HostInstant OfSector(const Sector& sector, HostInstant at) const;

  std::vector<Sector> sectors;
  std::vector<Plane> planes{2};  // the second is dead until it is started
  PlaneNetwork network;
  /// Receives each command of an agent, with its sector, before the sector's coordinator does.
  std::function<void(std::uint32_t, const SectorAgent&, const Command&)> commanded;
  /// Called after each step of time.
  std::function<void()> looked;
  /// No step of time passes over this instant.
  HostInstant look_at = kNever;

 private:
  void Turn();
  void TurnSector(std::uint32_t which);
  void TurnPlane(std::uint32_t which);
  void Deliver();
  [[nodiscard]] HostInstant Next() const;

  Options options_;
  std::unique_ptr<PlaneLayout> layout_;
  std::vector<UnitDrive> drives_;
  std::unique_ptr<sim::World> world_;
  HostInstant now_{Seconds(1).ns};
  std::uint64_t next_request_ = 1;
};

}  // namespace focalfleet::test
