// A plan: for every unit that moves, exactly the segments that go on the bus. The proof holds for
// what is sent: times are whole 100 us ticks after the start signal, ways are whole vectors.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "fleet/drive.h"
#include "protocol/base/ids.h"
#include "protocol/wire/staged_move.h"

namespace focalfleet {

struct UnitPlan {
  PositionerIndex unit;
  Pose from{};
  Pose to{};
  WaveMode mode = WaveMode::kAsymmetric;
  std::array<AxisPath, kAxisCount> path;
  /// A unit whose later motion enters space that this unit must first have left. If this unit ends
  /// early, the follower must be stopped before `begins_s` (its own first such motion), or they may
  /// touch.
  struct Follower {
    PositionerIndex unit;
    double begins_s = 0;  // seconds after the start signal
    /// This unit has left all of that space by then: if it ends later, the follower may go on. An
    /// end before `since_s` does not concern the follower either.
    double left_s = 0;
    double since_s = 0;
  };
  std::vector<Follower> followers;
};

enum class UnservedWhy : std::uint8_t {
  kDisabled,        // named target of a disabled unit: passed over
  kUnknownPlace,    // the unit's own position is an interval or unknown
  kBlocked,         // no collision-free way was found; `by` names a unit or obstacle in the way
  kTargetCollides,  // the target itself is not clear of what cannot move
};
const char* Name(UnservedWhy why);

/// A proof that no way leads to a pose, wherever all movable units stand (no_way.h).
struct NoWay {
  double grid_deg = 0;                 // grid of the boxes that were enough for it
  std::vector<PositionerIndex> walls;  // units that never move and close the way; ascending
  bool obstacle = false;               // fixed obstacles close it, too
};

struct Unserved {
  PositionerIndex unit;
  UnservedWhy why = UnservedWhy::kBlocked;
  std::optional<PositionerIndex> by;
  std::optional<NoWay> proof;  // of kBlocked; empty: a way may exist and was not found
};

/// The purpose of a plan. A preview is shown to an operator and never carried out.
enum class PlanPurpose : std::uint8_t { kConfiguration, kPreview };

/// Two units where they come nearest to each other.
struct TightPair {
  PositionerIndex a, b;
  double clearance_mm = 0;  // distance of the arms' surfaces minus the configured clearance: 0 is
                            // just clear
  double t_s = 0;           // after the start signal
};

/// A pair for which the early end of one unit may be noticed too late to stop the other.
struct Unnoticed {
  PositionerIndex ends;
  PositionerIndex follower;
  double at_s = 0;      // from here on it may be too late, in seconds after the start signal
  double leaves_s = 0;  // time that is left between the end of the one and the stop of the other
};

struct Plan {
  std::vector<UnitPlan> moves;     // ascending by unit; only units that move
  std::vector<Unserved> unserved;  // ascending by unit
  /// with PlanOptions::lead_apart: the pairs that are led apart, as text for operators
  std::string too_near;
  double makespan_s = 0;  // start signal to the last vector, by nominal clocks
  double bound_s = 0;     // no plan can be shorter: the slowest unit's shortest move alone
  /// No plan can be shorter either: the least time in which these two neighbours get there
  /// together, whatever all others do. Where no pair needs more than the slowest unit: that unit's
  /// time.
  double pair_bound_s = 0;
  std::optional<std::pair<PositionerIndex, PositionerIndex>> pair_bound_by;
  /// With PlanOptions::stall_tolerant: when each stage begins; the places of all units must be
  /// measured before. Seconds after the start signal.
  std::vector<double> stages_s;
  std::uint32_t crossings = 0;       // pairs of which one comes where the other was before
  std::vector<Unnoticed> unnoticed;  // those among them that the notice does not cover
  /// the pairs with the least clearance; empty: they were not looked for
  std::vector<TightPair> tightest;
};

/// The place of an axis `t_s` after the start signal by the unit's own clock: whole vectors applied
/// so far. Cost: O(segments).
std::int32_t PositionAt(std::int32_t from, const AxisPath& path, const AxisDrive& drive,
                        double t_s);

/// End of the last segment of both axes, seconds after the start signal.
double EndOf(const UnitPlan& plan, const UnitDrive& drive);

/// The lowest and highest position that the axis passes, both ends included.
struct Span {
  std::int32_t low = 0;
  std::int32_t high = 0;
};
Span SpanOf(std::int32_t from, const AxisPath& path);

}  // namespace focalfleet
