// The progress of the configuration under way: from a goal through its rounds to its end. Each
// function takes it over one edge of the table in configuration_phase.h. An edge waits for its
// input: answers, a plan, a durable batch, an exposure.
//
// Nothing starts before every unit of the plan holds its move, and before the store holds the
// intent of each. A unit that fails before the start costs a new plan. A unit that fails in motion
// stops the units whose way leads through where it may stand (UnitPlan::followers). The next round
// takes these on, unless they find a way while the others still move (late_moves.h). Every round
// and every late move uses a new move id, so a unit that kept an old move never starts with the
// others.
#pragma once

#include <cstdint>
#include <string>

#include "fleet/coordinate/executor_rooms.h"

namespace focalfleet {

/// All units of the round hold their moves, and their intents are durable. Units that home hold
/// nothing.
[[nodiscard]] bool IsHeld(const ExecutorRooms& rooms);

class ConfigurationProgress {
 public:
  /// `rooms` outlives this.
  explicit ConfigurationProgress(ExecutorRooms* rooms)
      : rooms_(*rooms),
        fleet_(rooms->fleet),
        configuration_(rooms->configuration),
        round_(rooms->round) {}

  void Begin(std::uint64_t request, const Goal& goal);
  void OnPlan(const PlanDone& done);
  /// The part of a plane's plan that this sector carries out. Pre: it waits for it.
  void TakeRound(const SectorRound& round);
  /// A round that has not started is given back, or a plan or an exposure is no use any more that
  /// is waited for: another plan is asked for.
  void Withdraw();
  void OnExposure(const ExposureDone& done);
  /// Goes on as far as it can now.
  void Advance();
  /// Stops all units, and ends the configuration when they have answered.
  void Stop(const std::string& reason);

 private:
  void Gather();
  void GatherIfDue();
  void BeginRound();
  void TakePlan(const PlanDone& done);
  void AdvanceUpload();
  void Disarm();
  void AdvanceCommit();
  void Start(HostInstant at);
  void StartHoming();
  void CountPrediction();
  [[nodiscard]] bool RoundIsOver() const;
  void EndRound();
  void EndHomingWave();
  void JudgeTargets();
  void MeasureOrEnd();
  void TakeMeasurement(ConfigurationMeasurement::Progress progress);
  void End();

  ExecutorRooms& rooms_;
  const Coordination& fleet_;     // of rooms_
  Configuration& configuration_;  // of rooms_
  Round& round_;                  // of rooms_
  HostInstant gather_until_ = kNever;
  bool sets_out_ = false;  // the next round is the first since the last exposure
};

}  // namespace focalfleet
