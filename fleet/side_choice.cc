#include "fleet/side_choice.h"

#include <algorithm>
#include <utility>

#include "fleet/geometry/clearance.h"

namespace focalfleet {
namespace {

class SideChooser {
 public:
  SideChooser(const Layout& layout, std::span<const UnitDrive> drives,
              std::vector<std::optional<SegmentFp>> standing,
              const std::vector<PoseChoice>& choices, std::vector<std::optional<Pose>>* poses)
      : layout_(layout),
        drives_(drives),
        choices_(choices),
        poses_(poses),
        arms_(std::move(standing)) {
    for (std::uint32_t i = 0; i < layout_.size(); ++i)
      if ((*poses_)[i]) arms_[i] = Arm(i, *(*poses_)[i]);
  }

  /// Each unit takes the pose that touches fewest, by the poses of the others.
  void TakeClearer() {
    constexpr int kPasses = 4;
    for (int pass = 0; pass < kPasses; ++pass) {
      bool changed = false;
      for (std::uint32_t i = 0; i < layout_.size(); ++i)
        if (choices_[i].size() > 1) changed |= Improve(i);
      if (!changed) return;
    }
  }

  [[nodiscard]] bool AreClear() const {
    for (std::uint32_t i = 0; i < layout_.size(); ++i)
      for (const PositionerIndex j : layout_.neighbours({i}))
        if (j.value < i && HasTarget(i) && HasTarget(j.value) && !AreClear(i, *arms_[i], j.value))
          return false;
    return true;
  }

  /// Decides all sides anew, each unit's preferred one first. A unit that has no clear side beside
  /// those that are decided keeps its pose, and binds nobody.
  void Decide() {
    sides_.assign(layout_.size(), {});
    decided_.assign(layout_.size(), kOpen);
    for (std::uint32_t i = 0; i < layout_.size(); ++i)
      if (HasTarget(i)) sides_[i] = SidesOf(i);
    for (std::uint32_t i = 0; i < layout_.size(); ++i) {
      if (decided_[i] != kOpen || sides_[i].empty()) continue;
      const bool found = [&] {
        for (std::size_t side = 0; side < sides_[i].size(); ++side)
          if (Assume(i, static_cast<int>(side))) return true;
        return false;
      }();
      if (!found) sides_[i].clear();
    }
    for (std::uint32_t i = 0; i < layout_.size(); ++i)
      if (decided_[i] != kOpen) (*poses_)[i] = sides_[i][Side(i)].pose;
  }

 private:
  static constexpr int kOpen = -1;
  struct PoseAndArm {
    Pose pose;
    SegmentFp arm;
  };

  [[nodiscard]] bool HasTarget(std::uint32_t i) const { return !choices_[i].empty(); }
  [[nodiscard]] std::size_t Side(std::uint32_t i) const {
    return static_cast<std::size_t>(decided_[i]);
  }
  [[nodiscard]] SegmentFp Arm(std::uint32_t i, const Pose& pose) const {
    return ArmAt(layout_.unit({i}), drives_[i], pose);
  }
  [[nodiscard]] bool AreClear(std::uint32_t i, const SegmentFp& arm, std::uint32_t j) const {
    return IsClear(layout_, {{i}, arm}, {{j}, *arms_[j]}, 0);
  }

  [[nodiscard]] int Touches(std::uint32_t i, const SegmentFp& arm) const {
    int count = 0;
    for (const PositionerIndex j : layout_.neighbours({i}))
      if (arms_[j.value] && !AreClear(i, arm, j.value)) ++count;
    return count + TouchesObstacles(i, arm);
  }
  [[nodiscard]] int TouchesObstacles(std::uint32_t i, const SegmentFp& arm) const {
    int count = 0;
    for (const Obstacle& obstacle : layout_.obstacles())
      if (!IsClear(layout_, {{i}, arm}, obstacle, 0)) ++count;
    return count;
  }

  bool Improve(std::uint32_t i) {
    int fewest = Touches(i, *arms_[i]);
    if (fewest == 0) return false;
    bool changed = false;
    for (const Pose& other : choices_[i]) {
      const SegmentFp arm = Arm(i, other);
      const int touches = Touches(i, arm);
      if (touches >= fewest) continue;
      fewest = touches;
      (*poses_)[i] = other;
      arms_[i] = arm;
      changed = true;
    }
    return changed;
  }

  /// Poses with different arms: a whole turn more is the same arm. Those alone that touch the
  /// fewest of what does not move.
  [[nodiscard]] std::vector<PoseAndArm> SidesOf(std::uint32_t i) const {
    constexpr double kSame_mm = 0.01;  // poses are rounded to whole vectors
    std::vector<PoseAndArm> sides;
    int fewest = 0;
    for (const Pose& pose : choices_[i]) {
      const SegmentFp arm = Arm(i, pose);
      int touches = TouchesObstacles(i, arm);
      for (const PositionerIndex j : layout_.neighbours({i}))
        if (!HasTarget(j.value) && arms_[j.value] && !AreClear(i, arm, j.value)) ++touches;
      if (!sides.empty() && touches > fewest) continue;
      if (touches < fewest) sides.clear();
      fewest = touches;
      const bool is_there = std::ranges::any_of(sides, [&](const PoseAndArm& side) {
        return DistanceMm(side.arm.a, arm.a) < kSame_mm && DistanceMm(side.arm.b, arm.b) < kSame_mm;
      });
      if (!is_there) sides.push_back({pose, arm});
    }
    return sides;
  }

  [[nodiscard]] bool Fit(std::uint32_t i, std::size_t side, std::uint32_t j,
                         std::size_t side_of_j) const {
    return IsClear(layout_, {{i}, sides_[i][side].arm}, {{j}, sides_[j][side_of_j].arm}, 0);
  }

  /// Takes the side and all that follows from it; nothing where that contradicts itself. A choice
  /// without contradiction need never be taken back, as each unit has two sides at most.
  bool Assume(std::uint32_t i, int side) {
    std::vector<std::uint32_t> taken = {i};
    decided_[i] = side;
    for (std::size_t at = 0; at < taken.size(); ++at)
      if (!Propagate(taken[at], &taken)) {
        for (const std::uint32_t back : taken) decided_[back] = kOpen;
        return false;
      }
    return true;
  }

  bool Propagate(std::uint32_t i, std::vector<std::uint32_t>* taken) {
    for (const PositionerIndex neighbour : layout_.neighbours({i})) {
      const std::uint32_t j = neighbour.value;
      if (sides_[j].empty()) continue;
      if (decided_[j] != kOpen) {
        if (!Fit(i, Side(i), j, Side(j))) return false;
        continue;
      }
      int last = kOpen;
      std::size_t left = 0;
      for (std::size_t side = 0; side < sides_[j].size(); ++side)
        if (Fit(i, Side(i), j, side)) last = static_cast<int>(side), ++left;
      if (left == 0) return false;
      if (left > 1) continue;  // either: nothing follows
      decided_[j] = last;
      taken->push_back(j);
    }
    return true;
  }

  const Layout& layout_;
  std::span<const UnitDrive> drives_;
  const std::vector<PoseChoice>& choices_;
  std::vector<std::optional<Pose>>* poses_;
  std::vector<std::optional<SegmentFp>> arms_;
  std::vector<std::vector<PoseAndArm>> sides_;  // empty: the unit binds nobody
  std::vector<int> decided_;                    // index of sides_, or kOpen
};

}  // namespace

void ChooseSides(const Layout& layout, std::span<const UnitDrive> drives,
                 std::vector<std::optional<SegmentFp>> standing,
                 const std::vector<PoseChoice>& choices, std::vector<std::optional<Pose>>* poses) {
  SideChooser chooser(layout, drives, std::move(standing), choices, poses);
  chooser.TakeClearer();
  if (!chooser.AreClear()) chooser.Decide();
}

}  // namespace focalfleet
