// The promises of a plan beyond "clear": how near the nearest pairs come and when, and which units
// to stop where a unit ends early.
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
/// first. The reported clearance is never more than the true one, and at most 10 um less. Shape:
/// `tracks` (n). Cost: O(n), most pairs are dismissed by their bounds.
std::vector<TightPair> FindTightest(const Scene& scene, std::span<const Track> tracks,
                                    const Tolerance& tolerance, std::size_t count);

/// A unit that may end early, and another that comes later where the first was. Times are seconds
/// after the start signal.
struct FollowingQuestion {
  const Track* ends = nullptr;
  const Track* comes = nullptr;
  double need_mm = 0;
  Tolerance proven;     // the two are clear of each other with this, its notice included
  double skew_s = 0;    // either may start this early or late
  double from_s = 0;    // the first has not ended before
  double notice_s = 0;  // wanted
};
struct Following {
  double since_s = 0;
  double begins_s = 0;
  double left_s = 0;
  double leaves_s = 0;  // at least, from the end of the first to the stop of the other
  [[nodiscard]] UnitPlan::Follower FollowerOf(PositionerIndex unit) const {
    return {unit, begins_s, left_s, since_s};
  }
};
/// Empty: the other never comes where the first was before. Cost: a distance for each two slices of
/// half a second that are near.
std::optional<Following> FindFollowing(const FollowingQuestion& question);

/// Fills the followers of every move: the units that must be stopped, and by when, if its unit ends
/// early. Counts the pairs that follow each other. Names the pairs with less than `notice_s`
/// between the end of one and the last moment to stop the other. Shape: `tracks` (n). Cost: O(n).
struct FollowersQuestion {
  const Scene* scene = nullptr;
  std::span<const Track> tracks;
  Tolerance tolerance;  // its notice is proven for all pairs but those in `without_notice`
  std::span<const std::pair<std::uint32_t, std::uint32_t>> without_notice;  // sorted, lower first
  double notice_s = 0;
};
void FindFollowers(const FollowersQuestion& question, Plan* plan);

}  // namespace focalfleet
