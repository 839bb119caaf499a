// The plan of the whole plane, and each sector's part of it.
//
// Which units may move. A unit moves only in a round in which every sector with a unit in its reach
// takes part. Units at the border of a sector that takes no part, its strip, stand where they are.
// Nothing that such a sector does meanwhile can then touch a unit that moves, whoever commands it:
// it may be dead, cut off, or under another coordinator. Its units are left out of the plan, their
// places need not be known.
//
// Homing. The moves that make way for a wave are a round of their own. The wave homes in a round in
// which nothing else moves.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "fleet/coordinate/effects.h"
#include "fleet/coordinate/inputs.h"
#include "fleet/coordinate/sector_round.h"
#include "fleet/plan/abandoned.h"
#include "fleet/plane/plane_layout.h"
#include "fleet/plane/plane_messages.h"

namespace focalfleet {

struct PlaneJob {
  std::uint64_t job = 0;
  std::vector<PositionerIndex> units;      // of the sectors that take part; ascending
  PlanJob plan;                            // Shape of its lists: as `units`
  std::vector<UnitDrive> drives;           // Shape: as `units`
  std::vector<std::uint8_t> strip;         // non-zero: stands beside a sector that takes no part
  std::vector<std::uint64_t> sector_jobs;  // Shape: (sectors); 0: takes no part
};

/// `jobs` has the job of each sector that takes part; null: it takes none. `notice_s` is the time
/// that the news of an end takes to the next sector, `clock_bound_s` by how much two sectors'
/// clocks may differ. Pre: FaultOf is empty for each job.
PlaneJob MakePlaneJob(std::uint64_t job, const PlaneLayout& plane,
                      std::span<const std::shared_ptr<const SectorJob>> jobs, double notice_s,
                      double clock_bound_s);

/// True: some unit is to home, or has a target, may go there, and is not there yet.
bool HasWork(const PlaneJob& job);

/// A pair across a border for which the end of one may be noticed too late to stop the other.
struct UnnoticedPair {
  UnitId ends;
  UnitId follower;
  double at_s = 0;
};

struct PlanePlan {
  std::vector<SectorRound> rounds;  // Shape: (sectors); of those that take no part without moves
  double makespan_s = 0;
  std::uint32_t moves = 0;
  std::uint32_t homing = 0;              // units that home; then there are no moves
  std::uint32_t follows_beyond = 0;      // pairs that follow each other across a border
  std::vector<UnnoticedPair> unnoticed;  // of these, where the notice is not enough
};

struct PlanePlanDone {
  std::uint64_t job = 0;
  Result<PlanePlan> plan;
};

/// The work of the planner's thread. Errors: as MakePlan.
PlanePlanDone RunPlaneJob(const PlaneJob& job, const PlaneLayout& plane,
                          const Abandoned& abandoned = {});

}  // namespace focalfleet
