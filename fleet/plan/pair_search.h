// The soonest ways of two units together, over all poses of both at once, among others that move.
//
// Where two arms are hooked into each other, neither can go first. The search spreads sets of joint
// poses over the steps of time (pose_grid.h): for each pose of the first unit a set of poses of the
// second. In a step each unit may stay or go to a pose beside its own. Clocks differ, so a step
// counts as clear only where the two are apart whichever of them goes first. The first step at
// which both are at their targets, and may stay there, is the soonest on the grid. The ways are
// read backwards from there; each of their steps is tested once more in its middle.
//
// Poses from which a unit by itself cannot reach its target in time any more, or that it cannot
// have reached yet, are left out. Where that leaves nothing, the answer comes at once.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <unordered_set>
#include <vector>

#include "fleet/plan/pose_grid.h"

namespace focalfleet {

class PairSearch {
 public:
  struct Question {
    std::array<StepQuestion, 2> units;  // with the same steps, end and rests
    double need_mm = 0;                 // the two must be farther apart than this
  };
  struct Found {
    std::array<AxisPaths, 2> paths;
    std::int32_t end_step = 0;
  };

  /// Empty: no way ends in time. Cost: up to some milliseconds a step.
  std::optional<Found> Find(const Question& question);
  /// Words of sets so far: what the searches cost.
  [[nodiscard]] std::uint64_t work() const { return work_; }

 private:
  /// The joint poses that can have been reached at one step.
  struct Layer {
    std::vector<std::int32_t> row_of;  // by pose of the first unit: its row; -1: none
    std::vector<std::uint64_t> rows;   // Shape: (rows, words of the second unit)
  };
  struct State {
    std::array<GridPose, 2> at{};
    std::int32_t step = 0;
  };
  using Turns = std::array<GridPose, 2>;

  bool FindLiving(std::size_t m, std::int32_t end_step);
  [[nodiscard]] const std::uint64_t* Living(std::size_t m, std::int32_t step) const {
    return living_[m].data() + static_cast<std::size_t>(step) * grid_[m].words();
  }
  [[nodiscard]] std::int32_t IndexOf(const GridPose& at) const {
    return at[0] * grid_[0].count(1) + at[1];
  }
  void SetUpLines();
  [[nodiscard]] bool IsSamePair(const Question& question) const;
  [[nodiscard]] double margin_mm() const;
  const std::uint64_t* ApartFrom(const GridPose& first);
  [[nodiscard]] bool IsApart(const GridPose& first, const GridPose& second) const;
  void TakeColumn(const GridPose& first, std::int32_t theta, std::uint64_t* row) const;
  bool Spread(std::int32_t end_step, std::vector<State>* way);
  void Step(std::int32_t step);
  void JoinNeighbours(const GridPose& at, const std::vector<std::uint64_t>& rows,
                      std::uint64_t* out) const;
  [[nodiscard]] bool Reached(const State& state) const;
  [[nodiscard]] bool StepClear(const State& before, const State& after);
  bool Read(const State& end, std::vector<State>* way);
  [[nodiscard]] std::optional<Found> LayOut(const std::vector<State>& way) const;

  Question q_;
  std::array<PoseGrid, 2> grid_;
  std::array<FreePoses, 2> free_;
  std::array<std::vector<std::uint64_t>, 2> living_;  // Shape: each (steps + 1, words)
  std::array<std::vector<SegmentFp>, 2> lines_;       // by pose
  /// Which poses are apart does not depend on others, nor on time: known until another pair comes.
  struct Apart {
    std::vector<std::int32_t> row_of;  // by pose of the first unit; -1: not known yet
    std::vector<std::uint64_t> rows;
  };
  std::size_t margin_ = 0;  // which of the margins counts
  std::array<Apart, 2> apart_;
  std::vector<Layer> layers_;
  std::uint64_t work_ = 0;
  // Scratch.
  std::vector<std::uint64_t> stay_;
  std::vector<std::uint64_t> second_goes_;
  std::vector<std::uint64_t> spread_;
  std::vector<std::uint64_t> first_goes_;
  std::vector<std::uint64_t> joined_;
  std::unordered_set<std::uint64_t> dead_;
};

}  // namespace focalfleet
