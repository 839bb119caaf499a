// The planner leads from any collision-free start to any collision-free target, provably clear,
// without sampling in time.
//
// The idea: all units go at once, straight. A unit that would meet another goes later or another
// way, within the time that the slowest unit needs anyhow (local_search.h, docs/adr/0007). Units
// may stand so close that this finds no end. Then an order is found in which they could go one at a
// time, and is run in parallel under one rule (sequential_planner.h, in_cell_planner.h, schedule.h,
// docs/adr/0003). Either way every pair is proven clear as the segments are sent, for every start
// skew and clock.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "fleet/plan/abandoned.h"
#include "fleet/plan/plan.h"
#include "fleet/plan/power_ledger.h"
#include "protocol/base/result.h"

namespace focalfleet {

struct PlanRequest {
  const Layout* layout = nullptr;
  std::span<const UnitDrive> drives;             // Shape: (n), by PositionerIndex
  std::span<const UnitKnowledge> start;          // Shape: (n)
  std::span<const std::optional<Pose>> targets;  // Shape: (n); none: ends where it stood
  /// Units that must not move whatever the targets say: disabled, silent, faulty. Non-zero is
  /// frozen. Shape: (n).
  std::span<const std::uint8_t> frozen;
  /// Motions known beforehand: a unit begins with its own, if it leads to its target. Shape: (n),
  /// or empty.
  std::span<const AxisPaths> motions = {};
  /// Non-zero: the unit is planned elsewhere, and its motion stands as it is. All others go around
  /// it at once, never in an order. Shape: (n), or empty: no unit is given. Pre: it starts at a
  /// place.
  std::span<const std::uint8_t> given = {};
  /// The place of a unit less its own count of vectors: a unit holds itself to its range by the
  /// count. Shape: (n), or empty: no unit differs.
  std::span<const Pose> offsets = {};
};

/// The use of the time that is there (objective.h).
enum class Objective : std::uint8_t { kSoonest, kLeastEnergy, kLeastPeak, kEvenPower };

struct PlanOptions {
  bool fixed = false;  // units without a target may not even be moved aside
  /// Pairs that start nearer than allowed (a unit was cut short while its neighbour went on) are no
  /// error. They are never brought nearer, and named in Plan::too_near.
  bool lead_apart = false;
  /// A unit that finds no way when all go at once stays where it stands, and the others go. The
  /// same holds for one of two whose targets would touch. For corrections: an order sends every
  /// unit through its cell, which costs all of them more than it serves.
  bool leave_stuck = false;
  double start_skew_s = 0.020;  // any unit may start this early or late
  double clock_error = 0.005;   // and its clock may run this fast or slow
  /// The time until a unit that has ended early is noticed and those that would run into it are
  /// stopped. Pairs for which the plan cannot promise that are in Plan::unnoticed.
  double notice_s = 1;
  /// The plan has stages: a unit that halts unseen anywhere in a stage touches no other as long as
  /// the next stage does not begin. Such a plan takes several times as long; Plan::stages_s says
  /// when to look at all units again.
  bool stall_tolerant = false;
  Objective objective = Objective::kSoonest;
  /// With another objective than kSoonest the plan ends by then (0: when the soonest one does).
  /// With kSoonest: the time that may be used at no cost, where the bound is shorter.
  double within_s = 0;
  /// CPU time for an earlier end than the first plan has, where that is far from the bound. The
  /// work is counted, so that the plan is the same on every machine.
  double improve_cpu_s = 1;
  std::uint64_t seed = 1;
  Abandoned abandoned = {};  // once true, MakePlan ends soon
  PowerLimits power = {};    // hard at every instant, for every skew and clock
  MotorModel motor = {};     // what the motors draw
};

/// A plan that serves every unit that can be served; the others are in Plan::unserved with the
/// reason.
/// Errors: kInvalid where starts collide (not with lead_apart) or targets do (not with
/// leave_stuck), all pairs named, or an array has the wrong size. kRefused where limits of power or
/// given motions leave no way. kUnavailable where it was abandoned.
/// Cost: O(n) for bounded neighbourhoods, a fraction of a second for 5000 units; path searches come
/// on top.
Result<Plan> MakePlan(const PlanRequest& request, const PlanOptions& options);

/// The request keeps what MakePlan asks of it. Errors: kInvalid, with all collisions of starts and
/// of targets named.
Status CheckPlanRequest(const PlanRequest& request, const PlanOptions& options);

/// Targets that send the neighbours of `homing` out of every place that its arm may pass on its way
/// home. Its phi goes to its upper stop first, from anywhere that its knowledge allows; then theta
/// goes to its lower stop. Units that stand clear already get no target. Shape: (n). Errors:
/// kRefused, names what stands in the way and cannot move.
Result<std::vector<std::optional<Pose>>> MakeWayForHoming(const PlanRequest& request,
                                                          PositionerIndex homing);

}  // namespace focalfleet
