// Several daemons plan one plate, each its own sector, with the promise of one plan: every pair is
// proven clear as the segments are sent.
//
// The idea. Sectors are strips of the plate, whole buses where that gives even ones, and take
// turns. Sectors of one turn have no neighbours in each other, so they are planned side by side.
// The number of turns is at most the number of colours in the graph of the sectors (two for strips,
// whatever their number).
//
// Halo. A sector plans its own units together with those around it, its halo. Units of the halo
// that an earlier turn has planned move as that turn decided. The others are planned along, to
// leave them room. The motion found for such a unit is a proposal that its own sector begins with:
// it is proven clear of this one. Both sides of a border thus have a say, although each unit's
// motion is decided by one sector, once.
//
// A sector's plan is a function of the request and of the plans of the sectors that it comes after.
// The machine and the moment of planning change nothing. Where a sector finds no way among the
// given motions, it and those that it comes after become one, and are planned again. In the worst
// case that ends with one plan for the whole plate.
//
// Proof. Pairs within a sector are proven by its plan. For a pair across a border the side with the
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
  /// Units within so many hops from neighbour to neighbour belong to the halo. At least 1.
  std::uint32_t halo_hops = 2;
  bool whole_rails = false;  // no two sectors share a rail: needed for limits of power per rail
};

/// Strips across x of about as many units each; every unit is in one of them. Buses stay whole
/// where each sector has at least four. Errors: kInvalid where there are fewer units (or rails)
/// than sectors. Cost: O(n log n).
Result<std::vector<Sector>> SplitIntoSectors(const Layout& layout, const SectorOptions& options);

struct SectorPlan {
  Plan plan;                        // of the sector's own units; its promises are not filled in yet
  std::vector<UnitPlan> proposals;  // for units of the halo whose turn comes later; ascending
};

/// The plan of one sector among the plans of earlier turns. `plans` has the plans of the sectors in
/// `sectors[which].after`; the others are not looked at. Shape: `plans` as `sectors`. Errors: as
/// MakePlan; kRefused too where no way is found among the motions of earlier turns. Cost: that of a
/// plan of the sector and its halo.
Result<SectorPlan> PlanSector(const PlanRequest& request, const PlanOptions& options,
                              std::span<const Sector> sectors,
                              std::span<const std::optional<SectorPlan>> plans,
                              std::uint32_t which);

/// The sectors' plans as one plan, changed for `options.objective`. Every pair is proven again;
/// followers, tightest pairs and makespan follow from the whole. Errors: kRefused where a pair
/// across a border is not clear: names all.
Result<Plan> JoinSectors(const PlanRequest& request, const PlanOptions& options,
                         std::span<const Sector> sectors,
                         std::span<const std::optional<SectorPlan>> plans);

/// Sectors `which` and those that it comes after become one; turns and halos are found anew.
std::vector<Sector> MergeSector(const Layout& layout, const SectorOptions& options,
                                std::span<const Sector> sectors, std::uint32_t which);

struct SectoredPlan {
  Plan plan;
  std::vector<Sector> sectors;  // the sectors that the plan was made of in the end
  std::uint32_t merged = 0;     // how often a sector became one with those before it
};

/// Splits, plans and joins in one process. Limits of power: rails are not shared, the total is
/// divided by the energy of straight ways. Errors: as MakePlan and SplitIntoSectors; kInvalid where
/// one of `request.given` is set.
Result<SectoredPlan> PlanBySectors(const PlanRequest& request, const PlanOptions& options,
                                   const SectorOptions& sectors);

}  // namespace focalfleet
