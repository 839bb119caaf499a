// One plate planned by several daemons, each its own sector, with the promise of one plan: every
// pair proven clear as the segments are sent.
//
// The idea: sectors are strips of the plate, whole buses where that gives even ones, and take
// turns: those of one turn have no neighbours in each other, so they are planned side by side, and
// nobody has to wait for more turns than there are colours in the graph of the sectors (two for
// strips, whatever their number). A sector plans its own units together with those around it, its
// halo. Units of the halo that an earlier turn has planned go as they were told. The others are
// planned along, to leave them room, and what was found for them is a proposal that their own
// sector begins with: it is proven clear of this one. So a border is a matter of both sides,
// although each unit's motion is decided by one sector, once.
//
// A sector's plan is a function of the request and of the plans of the sectors that it comes after.
// Who computes when, and where, changes nothing. Where a sector finds no way among what it is
// given, it and those that it comes after become one, and are planned again; in the worst case that
// ends with one plan for the whole plate.
//
// Proof. Pairs within a sector are proven by its plan; of a pair across a border the side with the
// later turn proves its unit clear of the other's motion, which no longer changes. JoinSectors does
// not trust that: it proves all pairs again.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"

namespace focalfleet {

struct Sector {
  std::vector<PositionerIndex> own;   // ascending
  std::vector<PositionerIndex> halo;  // ascending; of other sectors
  std::uint32_t turn = 0;
  std::vector<std::uint32_t> after;  // sectors of earlier turns with units in the halo; ascending
};

struct SectorOptions {
  std::uint32_t count = 1;
  /// Neighbours of neighbours and so on that belong to the halo. At least 1.
  std::uint32_t halo_hops = 2;
  bool whole_rails = false;  // no two sectors share one: needed for limits of power per rail
};

/// Strips across x of about as many units each; every unit in one of them. Buses stay whole where
/// there are four for each sector at least.
/// Errors: kInvalid where there are fewer units (or rails) than sectors. Cost: O(n log n).
Result<std::vector<Sector>> SplitIntoSectors(const Layout& layout, const SectorOptions& options);

struct SectorPlan {
  Plan plan;                        // of the sector's own units; what it promises is not known yet
  std::vector<UnitPlan> proposals;  // for units of the halo that have their turn later; ascending
};

/// `plans` has the plans of the sectors in `sectors[which].after` (the others are not looked at).
/// Shape: `plans` as `sectors`.
/// Errors: as MakePlan; kRefused too where no way is found among the motions of earlier turns.
/// Cost: that of a plan of the sector and its halo.
Result<SectorPlan> PlanSector(const PlanRequest& request, const PlanOptions& options,
                              std::span<const Sector> sectors,
                              std::span<const std::optional<SectorPlan>> plans,
                              std::uint32_t which);

/// One plan of all sectors' plans, with every pair proven again and what follows from the whole:
/// followers, tightest pairs, makespan; changed for `options.objective`.
/// Errors: kRefused where a pair across a border is not clear: names all.
Result<Plan> JoinSectors(const PlanRequest& request, const PlanOptions& options,
                         std::span<const Sector> sectors,
                         std::span<const std::optional<SectorPlan>> plans);

/// Sectors `which` and those that it comes after become one; turns and halos are found anew.
std::vector<Sector> MergeSector(const Layout& layout, const SectorOptions& options,
                                std::span<const Sector> sectors, std::uint32_t which);

struct SectoredPlan {
  Plan plan;
  std::vector<Sector> sectors;  // that it was made of in the end
  std::uint32_t merged = 0;     // how often a sector became one with those before it
};

/// All of the above in one process. Limits of power: rails are not shared, the total is divided by
/// the energy of straight ways. Errors: as MakePlan and SplitIntoSectors; kInvalid where one of
/// `request.given` is set.
Result<SectoredPlan> PlanBySectors(const PlanRequest& request, const PlanOptions& options,
                                   const SectorOptions& sectors);

}  // namespace focalfleet
