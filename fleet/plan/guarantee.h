// What a plan promises beyond "clear": how near the nearest pairs come and when, and whom to stop
// where a unit ends early.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/plan.h"
#include "fleet/plan/scene.h"
#include "fleet/plan/track.h"

namespace focalfleet {

/// The `count` pairs that come nearest for any start skew and clock within the tolerance, nearest
/// first; what is told is never more than the truth, and at most 10 um less. Shape: `tracks` (n).
/// Cost: O(n), most pairs are dismissed by their bounds.
std::vector<TightPair> FindTightest(const Scene& scene, std::span<const Track> tracks,
                                    const Tolerance& tolerance, std::size_t count);

/// One that may end early, and one that comes later where it was. Times after the start signal.
struct FollowingQuestion {
  const Track* ends = nullptr;
  const Track* comes = nullptr;
  double need_mm = 0;
  Tolerance proven;     // the two are clear of each other with this, its notice included
  double skew_s = 0;    // either may start this early or late
  double from_s = 0;    // it has not ended before
  double notice_s = 0;  // wanted
};
struct Following {
  double since_s = 0;
  double begins_s = 0;
  double left_s = 0;
  double leaves_s = 0;  // at least, from the end of the one to the stop of the other
  [[nodiscard]] UnitPlan::Follower FollowerOf(PositionerIndex unit) const {
    return {unit, begins_s, left_s, since_s};
  }
};
/// None: the other never comes where this one was before. Cost: a distance for each two slices of
/// half a second that are near.
std::optional<Following> FindFollowing(const FollowingQuestion& question);

/// Fills the followers of every move (who must be stopped before when, should that unit end early),
/// counts the pairs that follow each other, and names those for which less than `notice_s` is left
/// between the end and the last moment to stop the follower. Shape: `tracks` (n). Cost: O(n).
struct FollowersQuestion {
  const Scene* scene = nullptr;
  std::span<const Track> tracks;
  Tolerance tolerance;  // its notice: proven for all pairs but those in `without_notice`
  std::span<const std::pair<std::uint32_t, std::uint32_t>> without_notice;  // sorted, lower first
  double notice_s = 0;
};
void FindFollowers(const FollowersQuestion& question, Plan* plan);

}  // namespace focalfleet
