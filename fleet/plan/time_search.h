// A way for one unit among others that move. The search is A* over the unit's own square of angles
// and the times at which each pose is safe (safe interval path planning, Phillips and Likhachev
// 2011). Waiting in a safe pose costs no search, so a pose is looked at once for each of its safe
// intervals. Every step takes the same time; in it each axis turns one way, the other way, or not.
// A step is tested against the motions of the others as they are (track.h), so the way found holds
// in time. The way is laid out as segments and may be tested whole once more.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/track.h"

namespace focalfleet {

/// A neighbour whose motion is given.
struct MovingNeighbour {
  const ArmGeometry* arm = nullptr;
  const Track* track = nullptr;
  double need_mm = 0;
  Tolerance tolerance;
};

class TimeSearch {
 public:
  struct Question {
    const ArmGeometry* arm = nullptr;
    const UnitDrive* drive = nullptr;
    std::span<const MovingNeighbour> moving;
    std::span<const Blocker> standing;
    Pose from{};
    Pose to{};
    PoseBox within;
    double begin_s = 0;  // the unit stands until then
    double end_s = 0;    // the unit is at the target by then
    double grid_deg = 4;
    std::uint32_t expansions_max = 20'000;
  };

  /// The segments of a way. Empty: none was found. Cost: O(expansions * (moving + standing)).
  std::optional<AxisPaths> Find(const Question& question);

 private:
  /// Steps from `first` to `last` in which a pose may be held.
  struct Interval {
    std::int32_t first = 0;
    std::int32_t last = 0;
    std::int32_t node = -1;  // the node that reached it first; the earliest is the best
  };
  struct Node {
    std::int32_t came_from = -1;
    std::int32_t pose = 0;  // index into the grid
    std::int32_t interval = 0;
    std::int32_t step = 0;  // on which the node is reached
    std::int8_t turned[2] = {0, 0};
    bool done = false;
  };
  struct Open {
    std::int32_t total;  // steps, at least, until the target is reached for good
    std::int32_t left;
    std::int32_t node;
    bool operator<(const Open& o) const {
      if (total != o.total) return total > o.total;
      return left != o.left ? left > o.left : node < o.node;
    }
  };

  bool SetUp();
  [[nodiscard]] Pose PoseOf(std::int32_t pose) const;
  [[nodiscard]] Leg LegOf(const Pose& from, const Pose& to, std::int32_t step) const;
  [[nodiscard]] bool StepClear(const Leg& leg) const;
  [[nodiscard]] std::span<const Blocker> OfBundle(const Bundle& bundle) const {
    return q_.standing.subspan(bundle.begin, bundle.end - bundle.begin);
  }
  [[nodiscard]] std::int32_t StepsLeft(const Pose& pose) const;
  std::vector<Interval>& SafeAt(std::int32_t pose);
  void Expand(std::int32_t node);
  void Reach(const Node& node);
  [[nodiscard]] std::optional<AxisPaths> LayOut(std::int32_t node, std::int32_t leaves) const;
  [[nodiscard]] std::optional<AxisPaths> EndFrom(std::int32_t node) const;
  [[nodiscard]] bool EndsClear(const Pose& pose, std::int32_t step) const;

  Question q_;
  std::int64_t step_ticks_ = 0;
  double step_s_ = 0;
  std::int32_t steps_max_ = 0;
  std::int32_t target_safe_ = 0;  // the target may be held from this step on
  std::array<std::int32_t, kAxisCount> step_{};
  std::array<std::int32_t, kAxisCount> low_{};
  std::array<std::int32_t, kAxisCount> count_{};
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::vector<std::vector<Interval>> safe_;
  std::vector<std::uint8_t> known_;
  std::vector<std::uint8_t> blocked_;  // scratch: by step
  std::vector<Bundle> bundles_;        // of what stands
};

}  // namespace focalfleet
