// The configuration executor is the door to the configuration under way. Commands come in here and
// become goals (goal.h); answers of units, planner and camera go to the room that waits for them.
// ConfigurationProgress takes the configuration from phase to phase.
#pragma once

#include <cstdint>
#include <string>

#include "fleet/coordinate/commands.h"
#include "fleet/coordinate/configuration_progress.h"
#include "fleet/coordinate/executor_rooms.h"
#include "fleet/coordinate/preview.h"
#include "fleet/coordinate/sector_rounds.h"

namespace focalfleet {

class ConfigurationExecutor {
 public:
  /// The parts that `fleet` refers to outlive this.
  explicit ConfigurationExecutor(const Coordination& fleet)
      : rooms_(fleet), fleet_(rooms_.fleet), progress_(&rooms_) {}

  Status Apply(std::uint64_t request, const ApplyCommand& command);
  /// The plan that the command would begin with; nothing changes. Errors: as Apply.
  [[nodiscard]] Result<Preview> PreviewOf(const ApplyCommand& command) const;
  /// Gives one unit another target while the others move.
  Status Retarget(std::uint64_t request, const RetargetCommand& command);
  Status Home(std::uint64_t request, const HomeCommand& command);
  /// Measures once, by camera or sensors; no unit moves.
  Status Measure(std::uint64_t request);
  void StopAll() { StopAll("stopped by the operator"); }
  /// The operator stops one unit: it takes no further part in this goal.
  void StopUnit(PositionerIndex i);

  /// The daemon ends: the configuration that is under way ends with the counts that it has.
  void GiveUp();

  void OnPlan(const PlanDone& done) { progress_.OnPlan(done); }
  /// Where the daemon owns a sector of a plane.
  [[nodiscard]] SectorRounds sector_rounds() { return {&rooms_, &progress_}; }

  void OnExposure(const ExposureDone& done) { progress_.OnExposure(done); }
  void OnConfirm(PositionerIndex i, const ConfirmReply& reply);
  void OnArm(PositionerIndex i, const ArmReply& reply);
  void OnProgress(PositionerIndex i, const ProgressReply& reply);
  void OnHomeReply(PositionerIndex i, const HomeReply& reply);
  /// Takes the events of units since the last call, then goes on as far as it can.
  void Advance();

  [[nodiscard]] const ConfigurationView& view() const { return rooms_.configuration.view; }
  [[nodiscard]] bool busy() const { return rooms_.configuration.busy(); }
  [[nodiscard]] HostInstant due() const;
  /// The round under way, with the courses of its units and what was known of them before.
  [[nodiscard]] const Round& round() const { return rooms_.round; }

 private:
  [[nodiscard]] Status MayBegin(const std::string& source) const;
  void SetTarget(PositionerIndex i, const Goal& goal);
  void StopAll(const std::string& reason);
  void StoppedByAnotherHost(PositionerIndex i);

  ExecutorRooms rooms_;
  const Coordination& fleet_;  // of rooms_
  ConfigurationProgress progress_;
};

}  // namespace focalfleet
