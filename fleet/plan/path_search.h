// A way for one unit among things that stand still: the search runs over a grid in the unit's own
// square of angles (theta, phi). Every edge is a box of poses, and a box is taken only where all of
// it is clear, so the way found is as sound as a straight one. Most edges cost nothing: a pose
// whose clearance exceeds what the arm can travel along the edge proves the whole edge.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/geometry/arm.h"

namespace focalfleet {

/// What one unit must stay clear of during one search.
struct Blocker {
  Capsule capsule;
  double need_mm = 0;
  std::uint32_t by = 0;
};

class PathSearch {
 public:
  /// Where the way may go and where it shall end: any pose in `goal`; none: explore all that can be
  /// reached.
  struct Question {
    const ArmGeometry* arm = nullptr;
    std::span<const Blocker> blockers;
    Pose from{};
    PoseBox within;
    std::optional<PoseBox> goal;
    double grid_deg = 3;
  };

  /// Corners of the way, `from` first; the boxes between consecutive corners are clear of all
  /// blockers. Empty: none on this grid. Cost: O(nodes log nodes), nodes = (360 / grid_deg) * (180
  /// / grid_deg).
  std::vector<Pose> Find(const Question& question);

  /// All poses that the last Find reached, if it found no way; nearest first. Lifetime: until the
  /// next Find.
  [[nodiscard]] const std::vector<Pose>& reached() const { return reached_; }
  /// The way to one of them. Empty: not reached.
  std::vector<Pose> WayTo(std::size_t reached_index) const;

 private:
  struct Node {
    std::int32_t cost = -1;  // vectors of the slower axis, summed; -1: not seen
    std::int32_t came_from = -1;
    float clearance = 0;
    bool known = false;
    bool done = false;
  };
  struct Open {
    std::int64_t key;
    std::int32_t node;
    bool operator<(const Open& o) const { return key != o.key ? key > o.key : node > o.node; }
  };

  [[nodiscard]] Pose PoseOf(std::int32_t node) const;
  double ClearanceAt(std::int32_t node);
  bool EdgeClear(std::int32_t a, std::int32_t b);
  void Expand(std::int32_t node);
  [[nodiscard]] std::optional<Pose> EndNear(const Pose& pose) const;
  void SetUp(const Question& question);
  [[nodiscard]] std::int64_t Estimate(const Pose& pose) const;
  [[nodiscard]] std::vector<Pose> Trace(std::int32_t node) const;
  [[nodiscard]] std::vector<Pose> Shorten(std::vector<Pose> way) const;

  Question q_;
  std::int32_t step_[kAxisCount]{};
  std::int32_t low_[kAxisCount]{};  // grid index of the lowest pose within
  std::int32_t count_[kAxisCount]{};
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::vector<Pose> reached_;
  std::vector<std::int32_t> reached_nodes_;
};

/// Every pose of the box is clear of all blockers. `by` (may be null) receives the first that it is
/// not clear of.
bool BoxClear(const ArmGeometry& arm, const PoseBox& box, std::span<const Blocker> blockers,
              std::uint32_t* by, int budget = 3000);

}  // namespace focalfleet
