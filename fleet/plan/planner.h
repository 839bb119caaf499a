// From any collision-free start to any collision-free target, provably clear, without sampling in
// time.
//
// The idea: all go at once, straight, and who would meet somebody goes later or another way, within
// the time that the slowest unit needs anyhow (local search.h, docs/adr/0007). Where units stand so
// close that this finds no end, an order is found in which they could go one at a time, and is run
// in parallel under one rule (sequential planner.h, in_cell.h, schedule.h, docs/adr/0003). Either
// way every pair is proven clear as the segments are sent, for every start skew and clock.
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
  /// Motions that are known beforehand: what a unit may begin with, if it leads to its target.
  /// Shape: (n), or empty.
  std::span<const AxisPaths> motions = {};
  /// Non-zero: somebody else plans this unit, and its motion stands as it is. All others go around
  /// it at once, never in an order. Shape: (n), or empty: nobody. Pre: it starts at a place.
  std::span<const std::uint8_t> given = {};
  /// Where a unit stands less its own count of vectors: it holds itself to its range by the count.
  /// Shape: (n), or empty: nobody differs.
  std::span<const Pose> offsets = {};
};

/// What the time that is there is used for, objective.h.
enum class Objective : std::uint8_t { kSoonest, kLeastEnergy, kLeastPeak, kEvenPower };

struct PlanOptions {
  bool fixed = false;  // units without a target may not even step aside
  /// Pairs that start nearer than allowed (a unit was cut short while its neighbour went on) are no
  /// error: they are never brought nearer, and named in Plan::too_near.
  bool lead_apart = false;
  /// Who finds no way when all go at once, and one of two whose targets would touch, stays where it
  /// stands, and the others go. For corrections: an order sends everybody through its cell, which
  /// costs all of them more than it serves.
  bool leave_stuck = false;
  double start_skew_s = 0.020;  // any unit may start this early or late
  double clock_error = 0.005;   // and its clock may run this fast or slow
  /// How long it may take until a unit that has ended early is noticed and those that would run
  /// into it are stopped. Pairs for which the plan cannot promise that are in Plan::unnoticed.
  double notice_s = 1;
  /// In stages: a unit that halts unseen anywhere in one touches nobody as long as the next does
  /// not begin. Takes several times as long; Plan::stages_s says where to look at all units again.
  bool stall_tolerant = false;
  Objective objective = Objective::kSoonest;
  /// With another objective than kSoonest the plan ends by then (0: when the soonest one does).
  /// With kSoonest, time that may be used without being noticed, where the bound is shorter.
  double within_s = 0;
  std::uint64_t seed = 1;
  Abandoned abandoned = {};  // MakePlan then ends soon
  PowerLimits power = {};    // hard at every instant, for every skew and clock
  MotorModel motor = {};     // what the motors draw
};

/// A plan that serves every unit that can be served; the others are in Plan::unserved with the
/// reason. Errors: kInvalid where starts collide (not with lead_apart) or targets do (not with
/// leave_stuck), all pairs named, or an array has the wrong size; kRefused where limits of power or
/// given motions leave no way; kUnavailable where it was abandoned. Cost: O(n) for bounded
/// neighbourhoods, a fraction of a second for 5000 units; path searches come on top.
Result<Plan> MakePlan(const PlanRequest& request, const PlanOptions& options);

/// What MakePlan asks of its input, all collisions of starts and of targets named. Errors:
/// kInvalid.
Status CheckPlanRequest(const PlanRequest& request, const PlanOptions& options);

/// Targets that send the neighbours of `homing` out of every place that its arm may pass on its way
/// home: phi to its upper stop first, from anywhere that its knowledge allows, then theta to its
/// lower stop. Units that stand clear already get no target. Shape: (n). Errors: kRefused, names
/// what stands in the way and cannot move.
Result<std::vector<std::optional<Pose>>> MakeWayForHoming(const PlanRequest& request,
                                                          PositionerIndex homing);

}  // namespace focalfleet
