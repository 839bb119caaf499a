// A way for one unit that meets others as little as possible, among all ways over its grid of poses
// (pose_grid.h): the fewest steps in which it is too near to another, as a raster has it.
//
// The search spreads sets of poses over the steps. The set of level c at step s has every pose that
// the unit can have reached by then with at most c such steps. A set follows from the sets of the
// step before by a few operations on words, for all poses at once. The first level that reaches the
// target is the least. The way is then read backwards, and stands wherever that is possible: the
// unit goes as early as it can.
//
// The raster tells roughly what is too near, so the way found must be proven as a motion in time
// (track.h).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "fleet/plan/pose_grid.h"

namespace focalfleet {

class SoftSearch {
 public:
  struct Found {
    AxisPaths paths;
    std::int32_t meets = 0;  // steps in which the raster is not free
  };

  /// Empty: no way ends in time, or it has more segments than a move holds.
  std::optional<Found> Find(const StepQuestion& question);
  /// Words of sets so far: what the searches cost.
  [[nodiscard]] std::uint64_t work() const { return work_; }

 private:
  [[nodiscard]] std::uint64_t* Level(std::int32_t level, std::int32_t k) {
    return levels_[static_cast<std::size_t>(level)].data() +
           static_cast<std::size_t>(k) * grid_.words();
  }
  void SpreadLevel(const StepQuestion& question, std::int32_t level, bool all_free);
  [[nodiscard]] std::optional<AxisPaths> Read(const StepQuestion& question, std::int32_t level,
                                              bool all_free);
  [[nodiscard]] bool CameFrom(const GridPose& before, const GridPose& after, std::int32_t step,
                              std::int32_t* level, bool all_free);

  PoseGrid grid_;
  FreePoses free_;
  std::vector<std::vector<std::uint64_t>> levels_;  // Shape: (levels), each (steps + 1, words)
  std::vector<std::uint64_t> scratch_;
  std::vector<std::uint64_t> here_;
  std::vector<std::uint64_t> spread_;
  std::uint64_t work_ = 0;
};

}  // namespace focalfleet
