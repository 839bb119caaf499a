// Bundles of things that stand still. A unit of uncertain place is covered by up to 400 capsules,
// and each of its neighbours asks of all of them, pose after pose. Capsules that follow each other
// in a cover lie nearly on top of each other: a wider capsule around sixteen of them answers for
// all where it is far enough away, and only else they are looked at one by one. No answer changes.
//
// A bundle's core is the line of its middle thing. The farthest point of another line from it is an
// end of that line, because the distance to a convex set is convex.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "fleet/geometry/arm.h"

namespace focalfleet {

struct Bundle {
  /// An arm that is clear of this, without a need, is clear of each thing in it by its need.
  Capsule around;
  std::uint32_t begin = 0;
  std::uint32_t end = 0;  // behind the last one
  [[nodiscard]] bool has_several() const { return end > begin + 1; }
};

/// Things that follow each other and stand for the same unit, at most sixteen in a bundle. Thing: a
/// Blocker or StandingThing.
template <class Things>
void BundleUp(const Things& things, std::vector<Bundle>* bundles) {
  constexpr std::uint32_t kMost = 16;
  constexpr double kGuardMm = 1e-5;  // ten times what the distance of two segments may be off
  bundles->clear();
  const auto count = static_cast<std::uint32_t>(things.size());
  for (std::uint32_t begin = 0; begin < count;) {
    std::uint32_t end = begin + 1;
    while (end < count && end < begin + kMost && things[end].by == things[begin].by) ++end;
    const SegmentFp& core = things[begin + (end - begin) / 2].capsule.line;
    double radius_mm = 0;
    for (std::uint32_t k = begin; k < end; ++k) {
      const Capsule& capsule = things[k].capsule;
      const double out_mm =
          std::max(DistanceMm(capsule.line.a, core), DistanceMm(capsule.line.b, core));
      radius_mm = std::max(radius_mm, out_mm + capsule.radius_mm + things[k].need_mm + kGuardMm);
    }
    bundles->push_back({{core, radius_mm}, begin, end});
    begin = end;
  }
}

}  // namespace focalfleet
