// A way for one unit among others that move: A* over its own square of angles and time. Every step
// takes the same time; in it each axis turns one way, the other way, or waits. A step is tested
// against the motions of the others as they are (track.h), so what is found holds in time; it is
// laid out as segments and may be tested whole once more.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/path_search.h"
#include "fleet/plan/track.h"

namespace focalfleet {

/// Somebody whose motion is given.
struct Passer {
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
    std::span<const Passer> passers;
    std::span<const Blocker> standing;
    Pose from{};
    Pose to{};
    PoseBox within;
    double begin_s = 0;  // stands until then
    double end_s = 0;    // is at the target by then
    double grid_deg = 4;
    std::uint32_t expansions_max = 20'000;
  };

  /// Empty: none was found. Cost: O(expansions * (passers + standing)).
  std::optional<AxisPaths> Find(const Question& question);

 private:
  struct Node {
    std::int32_t came_from = -1;
    std::int32_t theta = 0;  // in steps from the start
    std::int32_t phi = 0;
    std::int32_t step = 0;
    std::int8_t turned[2] = {0, 0};
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

  void SetUp();
  [[nodiscard]] Pose PoseOf(const Node& node) const;
  [[nodiscard]] Leg LegOf(const Pose& from, const Pose& to, double begin_s, double end_s) const;
  [[nodiscard]] bool StepClear(const Leg& leg) const;
  [[nodiscard]] std::int32_t StepsLeft(const Pose& pose) const;
  std::optional<AxisPaths> LayOut(std::int32_t node) const;
  [[nodiscard]] bool EndsAt(const Node& node) const;

  Question q_;
  std::int64_t step_ticks_ = 0;
  std::array<std::int32_t, kAxisCount> step_{};
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::vector<std::uint8_t> seen_;
};

}  // namespace focalfleet
