// A way for one unit that meets others as little as possible. The search is A* over the unit's own
// square of angles and the runs of steps in which a pose is free, or is not (safe interval path
// planning with soft constraints, Li et al., MAPF-LNS2, 2022). Steps in which the unit is too near
// to another cost much, turning costs a little, and waiting costs nothing: a unit that has time
// waits where it harms no one.
//
// A raster (occupancy.h) tells roughly what is too near, so the way found must be proven as a
// motion in time (track.h).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "fleet/plan/occupancy.h"
#include "fleet/plan/path_search.h"
#include "fleet/plan/time_search.h"

namespace focalfleet {

/// Sets the bit of each step in which the arm at this pose is too near to what is around.
void RasterBitsAt(const ArmGeometry& arm, const Pose& pose, const Surround& around,
                  std::size_t words, std::uint64_t* bits);

/// Segments from turns of whole steps: turns that follow each other become one segment.
class StepPaths {
 public:
  StepPaths(const UnitDrive& drive, const TimeSteps& steps) : drive_(drive), steps_(steps) {}
  /// The axes turn by so many vectors from the begin of this step on. Pre: steps ascend.
  void Turn(std::int32_t step, const Pose& by);
  /// Empty: that takes more segments than a move holds.
  std::optional<AxisPaths> Take();

 private:
  void Close(std::size_t axis);
  const UnitDrive& drive_;
  const TimeSteps& steps_;
  AxisPaths paths_;
  struct Run {
    std::int32_t since = 0;
    std::int32_t until = -1;
    std::int32_t delta = 0;
  };
  std::array<Run, kAxisCount> runs_;
  bool fits_ = true;
};

class SoftSearch {
 public:
  struct Question {
    const ArmGeometry* arm = nullptr;
    const UnitDrive* drive = nullptr;
    const Surround* around = nullptr;
    std::span<const MovingNeighbour> moving;
    TimeSteps steps;
    Pose from{};
    Pose to{};
    PoseBox within;
    std::int32_t end_step = 0;  // the unit is at the target when this step begins
    /// Steps in which the unit may not move: power has no room. Empty: there are none.
    std::span<const std::uint8_t> rests;
    std::int32_t meets_cost = 60;
    std::uint32_t expansions_max = 4000;
  };
  struct Found {
    AxisPaths paths;
    std::int32_t meets = 0;  // steps in which the raster is not free
  };

  /// Empty: no way ends in time, or the number of expansions was not enough.
  std::optional<Found> Find(const Question& question);
  [[nodiscard]] std::uint64_t expansions() const { return expansions_; }

 private:
  struct Run {
    std::int16_t first = 0;
    std::int16_t last = 0;
    bool meets = false;
    std::int32_t node = -1;
  };
  struct PoseRuns {
    std::int32_t first = -1;  // into runs_; -1: not known yet
    std::int32_t count = 0;
  };
  struct Node {
    std::int32_t came_from = -1;
    std::int32_t pose = 0;
    std::int32_t run = 0;  // into runs_
    std::int32_t cost = 0;
    std::int16_t step = 0;
    std::int8_t turned[2] = {0, 0};
    bool done = false;
  };
  struct Open {
    std::int32_t key;
    std::int32_t left;
    std::int32_t node;
    bool operator<(const Open& o) const {
      if (key != o.key) return key > o.key;
      return left != o.left ? left > o.left : node < o.node;
    }
  };

  void SetUp();
  void FindRests();
  [[nodiscard]] Pose PoseOf(std::int32_t pose) const;
  void ExactBitsAt(const Pose& pose, std::uint64_t* bits) const;
  [[nodiscard]] bool IsTight(const Pose& pose) const;
  const PoseRuns& RunsAt(std::int32_t pose);
  [[nodiscard]] bool BitOf(std::int32_t pose, std::int32_t step) const {
    return (pose_bits_[static_cast<std::size_t>(pose) * words_ +
                       static_cast<std::size_t>(step / 64)] >>
                (step % 64) &
            1) != 0;
  }
  [[nodiscard]] std::int32_t StepsLeft(const Pose& pose) const;
  void Reach(const Node& node);
  void Expand(std::int32_t node);
  void ReachEnd(std::int32_t node);
  [[nodiscard]] std::optional<AxisPaths> LayOut(std::int32_t last) const;

  Question q_;
  std::size_t words_ = 0;
  std::array<std::int32_t, kAxisCount> step_{};
  std::array<std::int32_t, kAxisCount> low_{};
  std::array<std::int32_t, kAxisCount> count_{};
  std::vector<PoseRuns> pose_runs_;
  std::vector<std::uint64_t> pose_bits_;
  std::vector<Run> runs_;
  std::vector<Node> nodes_;
  std::vector<Open> open_;
  std::vector<std::uint64_t> target_bits_;
  std::vector<std::int32_t> target_meets_;  // by step: steps from then on in which the target meets
  std::vector<std::int32_t> may_leave_;     // by step: the first from then on in which it may move
  std::int32_t best_end_ = -1;
  std::uint64_t expansions_ = 0;
};

}  // namespace focalfleet
