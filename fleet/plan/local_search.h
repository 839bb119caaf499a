// The local search plans all units at once: every unit goes straight to its target. Where two would
// meet, one of them goes later or another way, within the time that the slowest unit needs anyhow.
//
// Most units need far less time than the slowest one, so there is room to wait in. The repair is
// local and greedy. A unit in conflict looks through its candidates (candidates.h) for the one that
// meets the fewest others as these move now. Each unit that it still meets looks next. A pair that
// keeps meeting weighs more each time. These weights drive the search out of dead ends (breakout
// local search, Morris 1993; repair instead of construction as in MAPF-LNS2, Li et al. 2022). Every
// choice is tested as a motion in time (track.h), so nothing has to be proven afterwards.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/abandoned.h"
#include "fleet/plan/candidates.h"
#include "fleet/plan/power_ledger.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"

namespace focalfleet {

struct LocalSearchResult {
  /// Shape: (n). Empty paths: the unit stands.
  std::vector<AxisPaths> paths;
  std::vector<Track> tracks;
  /// ascending; empty: all are clear of each other at all times
  std::vector<std::uint32_t> in_conflict;
  bool starved = false;  // the limits of power leave a unit no time at all: nothing was tried
  double work_s = 0;  // of a dense search, counted. Units: s of CPU of a usual machine
  /// Pairs that are clear, but not with notice. Lower index first, sorted.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> without_notice;
};

struct LocalSearchRequest {
  const Scene* scene = nullptr;
  std::span<const UnitDrive> drives;      // Shape: (n)
  std::span<const Pose> from;             // Shape: (n)
  std::span<const Pose> to;               // Shape: (n)
  std::span<const std::uint8_t> movable;  // Shape: (n); others stand
  std::span<const AxisPaths> begin_with;  // Shape: (n), or empty: straight ways
  /// Non-zero: the unit moves as `begin_with` says, whatever the others do, and its power is
  /// counted by the caller. Two such units are not tested against each other. Shape: (n), or empty:
  /// no unit is given.
  std::span<const std::uint8_t> given = {};
  PowerLedger* ledger = nullptr;  // empty at first; null: power has no limit
  Tolerance tolerance;
  double within_s = 0;  // the time that may be used at no cost
  std::uint64_t seed = 1;
  Abandoned abandoned = {};  // once true, no unit looks for another way
};

/// The paths lead from the unit's start to its target.
bool Reaches(const LocalSearchRequest& request, std::uint32_t unit, const AxisPaths& paths);

/// A motion for every unit of the request, straight wherever that is clear. Cost: O(n) for bounded
/// neighbourhoods; a unit without conflicts costs one test for each neighbour.
LocalSearchResult SearchLocally(const LocalSearchRequest& request);

}  // namespace focalfleet
