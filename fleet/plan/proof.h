// A proof of existing motions, wherever they came from: which pairs are clear, and with how much
// notice. How the motions were found is not assumed.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/plan.h"
#include "fleet/plan/planner.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"

namespace focalfleet {

using IndexPair = std::pair<std::uint32_t, std::uint32_t>;  // the lower one first

struct Proof {
  std::vector<IndexPair> without_notice;  // sorted; includes those that are not clear
  /// Pairs that the test cannot show to be clear, and units (twice) that it cannot show clear of
  /// what stands; sorted. Empty: everything is clear for every skew and clock.
  std::vector<IndexPair> unproven;
};

inline Tolerance ToleranceOf(const PlanOptions& options) {
  return {options.start_skew_s, options.clock_error, options.notice_s};
}

/// The tracks of all units; empty for units without a place. Shape: (n).
std::vector<Track> TracksOf(const Scene& scene, const PlanRequest& request,
                            std::span<const UnitPlan> moves);

/// Where each unit ends: units that do not move, where they start. Shape: (n).
std::vector<Pose> EndsOf(const PlanRequest& request, std::span<const UnitPlan> moves);

/// A scene whose needs allow for where the moves start and end.
Scene SceneOf(const PlanRequest& request, std::span<const UnitPlan> moves);

/// Tests all pairs of neighbours, and every unit against what stands. Cost: at most two tests of
/// each pair of neighbours, O(n).
Proof Prove(const Scene& scene, std::span<const Track> tracks, const Tolerance& tolerance);

/// Fills in makespan, bound, followers and tightest pairs of a plan whose moves are final.
void FillPromises(const PlanRequest& request, const PlanOptions& options, const Scene& scene,
                  std::span<const Track> tracks, const Proof& proof, Plan* plan);

}  // namespace focalfleet
