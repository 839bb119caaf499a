// A way for one unit among things that stand still. The search runs over a grid in the unit's own
// square of angles (theta, phi). Every edge is a box of poses, and a box is taken only where all of
// it is clear. The way found is therefore as sound as a straight one. Most edges cost nothing: a
// pose whose clearance exceeds what the arm can travel along the edge proves the whole edge.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "fleet/geometry/arm.h"
#include "fleet/plan/abandoned.h"
#include "fleet/plan/bundles.h"

namespace focalfleet {

/// An obstacle that a unit must stay clear of during one search.
struct Blocker {
  Capsule capsule;
  double need_mm = 0;
  std::uint32_t by = 0;
};

/// A corner of a way and how the leg to it is made: the axes each in their own time, or in step.
struct Waypoint {
  Pose pose{};
  double out_of_step = 1;  // as in Sweep, of the leg that ends here
};
using Way = std::vector<Waypoint>;

/// A pace for which both axes of a unit begin and end a leg together. The axis with less to do
/// takes more carrier periods a vector. Empty: that is beyond what a vector may take.
struct InStep {
  std::array<std::uint8_t, kAxisCount> repeat{};
  double out_of_step = 1;
};
std::optional<InStep> KeepInStep(const Pose& from, const Pose& to, const UnitDrive& drive);

/// All poses that the axes' ranges allow, and where the unit stands should that be outside.
PoseBox RangeAround(const ArmGeometry& arm, const Pose& pose);

/// Coarse first: most ways are wide.
inline constexpr std::array kSearchGridsDeg{3.0, 1.0};

class PathSearch {
 public:
  explicit PathSearch(Abandoned abandoned = {}) : abandoned_(std::move(abandoned)) {}

  /// Where the way may go and where it shall end: any pose in `goal`. Empty goal: explore all that
  /// can be reached.
  struct Question {
    const ArmGeometry* arm = nullptr;
    const UnitDrive* drive = nullptr;
    std::span<const Blocker> blockers;
    Pose from{};
    PoseBox within;
    std::optional<PoseBox> goal;
    double grid_deg = 3;
  };

  /// The corners of the way, `from` first; the legs between them are clear of all blockers. Empty:
  /// none on this grid, or abandoned. Cost: O(nodes log nodes), nodes = (360 / grid_deg) * (180 /
  /// grid_deg).
  Way Find(const Question& question);
  [[nodiscard]] bool abandoned() const { return IsAbandoned(abandoned_); }

  /// The poses that the last Find reached, if it found no way; nearest first. Lifetime: until the
  /// next Find.
  [[nodiscard]] const std::vector<Pose>& reached() const { return reached_; }
  /// The way to one of them. Empty: not reached.
  [[nodiscard]] Way WayTo(std::size_t reached_index) const;

 private:
  struct Node {
    std::int32_t cost = -1;  // vectors of the slower axis, summed; -1: not reached
    std::int32_t came_from = -1;
    float clearance = -1;  // at least this much, exactly this much where `exact`
    bool exact = false;
    bool done = false;
  };
  struct Open {
    std::int64_t key;
    std::int32_t node;
    bool operator<(const Open& o) const { return key != o.key ? key > o.key : node > o.node; }
  };

  [[nodiscard]] Pose PoseOf(std::int32_t node) const;
  double ExactClearance(std::int32_t index);
  bool EdgeClear(std::int32_t a, std::int32_t b);
  void Expand(std::int32_t node);
  [[nodiscard]] std::optional<Pose> EndNear(const Pose& pose) const;
  void SetUp(const Question& question);
  [[nodiscard]] std::int64_t Estimate(const Pose& pose) const;
  [[nodiscard]] std::vector<Pose> Trace(std::int32_t node) const;
  [[nodiscard]] Way Shorten(const std::vector<Pose>& way) const;
  [[nodiscard]] Way WithFewestCorners(const std::vector<Pose>& way) const;
  [[nodiscard]] std::optional<Waypoint> Leg(const Pose& from, const Pose& to) const;

  Abandoned abandoned_;
  Question q_;
  std::int32_t step_[kAxisCount]{};
  std::int32_t low_[kAxisCount]{};  // grid index of the lowest pose within
  std::int32_t count_[kAxisCount]{};
  std::vector<Node> nodes_;
  std::vector<Bundle> bundles_;  // of the blockers
  /// the blocker that was nearest last; it is likely to be near the next node, too
  std::size_t last_nearest_ = 0;
  std::vector<Open> open_;
  std::vector<Pose> reached_;
  std::vector<std::int32_t> reached_nodes_;
};

/// True: every pose of the sweep is clear of all blockers. `by` (may be null) receives the first
/// that it is not clear of.
bool SweepClear(const ArmGeometry& arm, const Sweep& sweep, std::span<const Blocker> blockers,
                std::uint32_t* by, int budget = 3000);

}  // namespace focalfleet
