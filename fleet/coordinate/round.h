// A round carries out one plan: its moves, and for each unit the part that it has in it. The round
// is also the clock of the plan: times of the plan count from its start signal.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_map>
#include <vector>

#include "fleet/coordinate/inputs.h"
#include "fleet/coordinate/sector_round.h"
#include "fleet/knowledge.h"
#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/replan.h"
#include "protocol/base/instants.h"

namespace focalfleet {

/// Where a unit is in this round.
enum class Part : std::uint8_t { kNone, kWaiting, kUploading, kHolding, kMoving };
inline constexpr std::size_t kPartCount = 5;

/// The plane's side of a round, where the daemon owns one sector of a plane.
struct BorderRound {
  std::vector<SectorRound::FollowsBeyond> follows;
  std::unordered_map<std::uint32_t, SectorRound::LeadsBeyond> leads;  // by unit
  bool finished = false;                                              // no round follows
  ConfigurationState end = ConfigurationState::kDone;                 // SectorRound::end
  HostInstant start_at = kNever;                                      // kNever: held
};

struct RoundUnit {
  static constexpr std::size_t kNoPlan = SIZE_MAX;
  /// Knowledge before an intent that has not begun.
  struct Before {
    UnitKnowledge knowledge;
    Pose offset{};
    MoveId move;  // of the intent
  };

  std::size_t plan = kNoPlan;  // index of its move in Round::plan
  Part part = Part::kNone;
  std::uint8_t stage_tries = 0;
  std::uint8_t goes_on = 0;  // how often it was taken up again in this round
  // Its move has ended before it can have been over. The unit then stands, also where its move
  // ends: one that makes way and comes back has its end where it began.
  bool ended_early = false;
  std::optional<Before> before;
};

/// A late move from when it is planned until the round is over or the unit gets another.
struct LateCourse {
  LateMove late;
  MoveId move;
};

class Round {
 public:
  explicit Round(std::size_t units) : units_(units) {}

  [[nodiscard]] RoundUnit& operator[](PositionerIndex i) { return units_[i.value]; }
  [[nodiscard]] const RoundUnit& operator[](PositionerIndex i) const { return units_[i.value]; }
  [[nodiscard]] Part part(PositionerIndex i) const { return units_[i.value].part; }
  void SetPart(PositionerIndex i, Part part);
  /// How many units are in a part. Pre: not kNone.
  [[nodiscard]] std::uint32_t count(Part part) const {
    return counts_[static_cast<std::size_t>(part)];
  }
  [[nodiscard]] bool HasParts() const;  // some unit has a part in the round

  /// The plan of this round is `next`; no unit has a number of an earlier plan any more.
  void TakePlan(const Plan& next);
  /// Null: no move of this round.
  [[nodiscard]] UnitPlan* PlanOf(PositionerIndex i);
  [[nodiscard]] const UnitPlan* PlanOf(PositionerIndex i) const;
  [[nodiscard]] MoveId MoveOf(PositionerIndex i) const;
  [[nodiscard]] HostInstant AtPlanTime(double t_s) const { return started + Seconds(t_s); }
  /// When the clock of the unit's move began: its own start signal where it is late.
  [[nodiscard]] HostInstant BeganOf(PositionerIndex i) const;

  /// The move that a unit carries out now, and when its clock began; none: it does not move by the
  /// plan.
  struct Course {
    const UnitPlan* plan = nullptr;
    HostInstant began;
  };
  [[nodiscard]] std::optional<Course> CourseOf(PositionerIndex i) const;
  /// Knowledge of the unit before an intent that has not begun; null: it has none.
  [[nodiscard]] const UnitKnowledge* BeforeOf(PositionerIndex i) const {
    const std::optional<RoundUnit::Before>& before = units_[i.value].before;
    return before ? &before->knowledge : nullptr;
  }

  /// Gives a unit a late move, under a number of its own.
  void AddLate(PositionerIndex i, const LateMove& late, MoveId move);
  /// Takes a late move back that has not begun: the unit stands.
  void DropLate(PositionerIndex i);
  [[nodiscard]] bool IsLate(PositionerIndex i) const { return late_.contains(i.value); }
  /// Null: none.
  [[nodiscard]] const LateMove* LateOf(PositionerIndex i) const;

  /// The round is over: no unit has a move.
  void End();
  /// The configuration is over: no unit has a move or a part.
  void Clear();

  std::uint64_t job = 0;  // the last plan job asked for
  Plan plan;
  MoveId move;
  std::shared_ptr<const RunningPlan> running;  // the basis of late moves; null: none can be planned
  PlanPrediction prediction;                   // added to the view when the motion starts
  BorderRound border;
  double end_s = 0;                // predicted, after the start signal
  std::uint64_t commit_batch = 0;  // of the intents
  HostInstant started = kNever;    // the start signal
  HostInstant last_arrival;
  std::uint64_t settled_batch = 0;  // with which the end of the last motion becomes durable
  // The start skew that this round is planned for, and that the next one will be: any unit may
  // start this much early or late.
  double skew_s = PlanOptions{}.start_skew_s;
  double next_skew_s = PlanOptions{}.start_skew_s;

 private:
  std::vector<RoundUnit> units_;
  std::array<std::uint32_t, kPartCount> counts_{};
  std::unordered_map<std::uint32_t, LateCourse> late_;  // by unit
};

}  // namespace focalfleet
