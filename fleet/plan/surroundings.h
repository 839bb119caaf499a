// The things around one unit, and the search for a way among them: scratch that outlives one plan
// step.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/scene.h"

namespace focalfleet {

class Surroundings {
 public:
  /// `start` outlives this. Shape: (n).
  Surroundings(const Scene* scene, std::span<const Pose> start, Abandoned abandoned = {})
      : scene_(scene), start_(start), search_(std::move(abandoned)) {}

  enum class Include : std::uint8_t {
    kAll,
    kOutOfCell,  // no units inside their own cells: for ways that never leave the unit's own cell
  };
  /// Everything near `unit`, with the others at `poses`. Lifetime: until the next call.
  std::span<const Blocker> Around(std::uint32_t unit, std::span<const SegmentFp> lines,
                                  std::span<const Pose> poses, Include include);
  /// Only the units in `these`, as they start, and the standing things. Shape: (n).
  std::span<const Blocker> AroundOf(std::uint32_t unit, std::span<const std::uint8_t> these);
  PathSearch& search() { return search_; }

 private:
  const Scene* scene_;
  std::span<const Pose> start_;
  PathSearch search_;
  std::vector<Blocker> blockers_;
};

}  // namespace focalfleet
