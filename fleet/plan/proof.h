// What holds of motions that are there already, wherever they came from: which pairs are clear, and
// with how much notice. Nothing of how they were found is assumed.
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
  std::vector<IndexPair> without_notice;  // sorted; those that are not clear are among them
  /// Pairs that the test cannot show to be clear, and units (twice) that it cannot show clear of
  /// what stands; sorted. Empty: everything is clear for every skew and clock.
  std::vector<IndexPair> unproven;
};

inline Tolerance ToleranceOf(const PlanOptions& options) {
  return {options.start_skew_s, options.clock_error, options.notice_s};
}

/// Shape: (n), of units without a place empty.
std::vector<Track> TracksOf(const Scene& scene, const PlanRequest& request,
                            std::span<const UnitPlan> moves);

/// Where everybody ends: units that do not move where they start. Shape: (n).
std::vector<Pose> EndsOf(const PlanRequest& request, std::span<const UnitPlan> moves);

/// A scene whose needs allow for where the moves start and end.
Scene SceneOf(const PlanRequest& request, std::span<const UnitPlan> moves);

/// Cost: two tests of each pair of neighbours at most, O(n).
Proof Prove(const Scene& scene, std::span<const Track> tracks, const Tolerance& tolerance);

/// Makespan, bound, followers and tightest pairs of a plan whose moves are final.
void FillPromises(const PlanRequest& request, const PlanOptions& options, const Scene& scene,
                  std::span<const Track> tracks, const Proof& proof, Plan* plan);

}  // namespace focalfleet
