// A unit's square of angles as a grid of poses, a step of time from each to its neighbours, and for
// each pose the steps in which it is free of all others. Each pose has one bit. A whole column
// of poses (one theta, all phi) is one word, so that one operation on a word decides about all of
// them, and a search over all poses and times takes as long as a few hundred distances of arms.
//
// Start and target are both on the grid: the interval next to the target is a part of a step.
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

/// A place on the grid: indices of theta and phi.
using GridPose = std::array<std::int32_t, kAxisCount>;

class PoseGrid {
 public:
  void SetUp(const UnitDrive& drive, const TimeSteps& steps, const Pose& from, const Pose& to,
             const PoseBox& within);

  [[nodiscard]] Pose At(const GridPose& at) const {
    return {vectors_[0][static_cast<std::size_t>(at[0])],
            vectors_[1][static_cast<std::size_t>(at[1])]};
  }
  [[nodiscard]] const GridPose& from() const { return from_; }
  [[nodiscard]] const GridPose& to() const { return to_; }
  [[nodiscard]] std::int32_t count(std::size_t axis) const {
    return static_cast<std::int32_t>(vectors_[axis].size());
  }
  [[nodiscard]] bool Contains(const GridPose& at) const {
    return at[0] >= 0 && at[1] >= 0 && at[0] < count(0) && at[1] < count(1);
  }
  /// The least number of steps between two poses.
  static std::int32_t StepsBetween(const GridPose& a, const GridPose& b);

  /// Words of a set of poses: for each theta a column of phi, and an empty column at either end.
  [[nodiscard]] std::size_t words() const { return (vectors_[0].size() + 2) * words_per_column_; }
  [[nodiscard]] std::size_t words_per_column() const { return words_per_column_; }
  [[nodiscard]] std::size_t WordOf(const GridPose& at) const {
    return static_cast<std::size_t>(at[0] + 1) * words_per_column_ +
           static_cast<std::size_t>(at[1] / 64);
  }
  static std::uint64_t BitOf(const GridPose& at) { return std::uint64_t{1} << (at[1] % 64); }
  [[nodiscard]] bool Has(const std::uint64_t* set, const GridPose& at) const {
    return (set[WordOf(at)] & BitOf(at)) != 0;
  }

  /// `out`: the poses within a step of those in `set`. `scratch` is as long as a set.
  void Spread(const std::uint64_t* set, std::uint64_t* scratch, std::uint64_t* out) const;

 private:
  std::array<std::vector<std::int32_t>, kAxisCount> vectors_;
  GridPose from_{};
  GridPose to_{};
  std::size_t words_per_column_ = 1;
};

/// Sets the bit of each step in which an arm there is too near to what is around. `words`: the
/// first words of steps, and how many a cell has.
struct StepWords {
  std::size_t first = 0;
  std::size_t of_cell = 0;
};
void RasterBitsAt(const SegmentFp& line, const Surround& around, const StepWords& words,
                  std::uint64_t* bits);

/// The question to a search for one unit's way.
struct StepQuestion {
  const ArmGeometry* arm = nullptr;
  const UnitDrive* drive = nullptr;
  const Surround* around = nullptr;
  std::span<const MovingNeighbour> moving;  // the same, exactly, for poses next to either end
  std::span<const StandingThing> standing;
  TimeSteps steps;
  Pose from{};
  Pose to{};
  PoseBox within;
  std::int32_t end_step = 0;  // the unit is at the target when this step begins
  /// Steps in which the unit may not move: power has no room. Empty: there are none.
  std::span<const std::uint8_t> rests;
  [[nodiscard]] bool MayMove(std::int32_t step) const {
    return rests.empty() || rests[static_cast<std::size_t>(step)] == 0;
  }
};

/// For each step, the poses of a unit that are free of all others in it.
class FreePoses {
 public:
  void SetUp(const StepQuestion& question, const PoseGrid& grid);
  /// Only poses on some way that ends in time are in these sets.
  [[nodiscard]] const std::uint64_t* In(std::int32_t step) const {
    return free_.data() + static_cast<std::size_t>(step) * words_;
  }
  /// All poses on ways that end in time, free or not.
  [[nodiscard]] const std::uint64_t* all() const { return all_.data(); }

 private:
  /// Where something is during some steps.
  struct Part {
    SegmentFp line;
    double need_mm = 0;
    std::int32_t first = 0;
    std::int32_t last = 0;
  };
  void FindParts(const StepQuestion& question, const PoseGrid& grid);
  void ExactBitsAt(const SegmentFp& line, std::uint64_t* bits) const;
  std::uint64_t TakeColumn(const StepQuestion& question, const PoseGrid& grid, const GridPose& from,
                           std::size_t row);
  void TurnBlock(const StepQuestion& question, std::size_t word,
                 const std::array<std::uint64_t, 2>& inside, std::size_t second_row);
  std::size_t words_ = 0;
  StepWords step_words_;
  std::vector<std::uint64_t> free_;  // Shape: (steps, words)
  std::vector<std::uint64_t> all_;
  std::vector<std::uint64_t> bits_;  // scratch, Shape: (64 poses, words of steps)
  std::vector<Direction> folds_;     // scratch, of each phi
  std::vector<Part> parts_;          // scratch, near start and target
};

/// Segments from turns of whole steps: turns that follow each other become one segment.
class StepPaths {
 public:
  StepPaths(const UnitDrive& drive, const TimeSteps& steps);
  /// The axes turn by so many vectors from the begin of this step on. Pre: steps ascend.
  void Turn(std::int32_t step, const Pose& by);
  /// Empty: that takes more segments than a move holds.
  std::optional<AxisPaths> Take();

 private:
  void Close(std::size_t axis);
  const UnitDrive& drive_;
  const TimeSteps& steps_;
  std::array<std::int32_t, kAxisCount> whole_{};  // vectors of a whole step
  AxisPaths paths_;
  struct Run {
    std::int32_t since = 0;
    std::int32_t until = -1;
    std::int32_t delta = 0;
  };
  std::array<Run, kAxisCount> runs_;
  bool fits_ = true;
};

/// Vectors that an axis turns in a step.
std::int32_t VectorsPerStep(const AxisDrive& drive, const TimeSteps& steps);

}  // namespace focalfleet
