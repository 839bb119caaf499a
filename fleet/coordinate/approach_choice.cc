#include "fleet/coordinate/approach_choice.h"

#include <algorithm>

#include "fleet/geometry/clearance.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

class Chooser {
 public:
  Chooser(const Layout& layout, std::span<const UnitDrive> drives,
          std::span<const ApproachWish> units, double guard_mm)
      : layout_(layout), drives_(drives), units_(units), guard_mm_(guard_mm) {
    for (std::uint32_t n = 0; n < units.size(); ++n) {
      chosen_.push_back(units[n].otherwise);
      arms_.push_back(units[n].otherwise ? std::optional(ArmOfUnit({n}, *units[n].otherwise))
                                         : std::nullopt);
    }
  }

  /// True where some unit got a better pose than it had.
  bool Pass() {
    bool changed = false;
    for (std::uint32_t n = 0; n < units_.size(); ++n)
      changed |= units_[n].otherwise && Improve({n});
    return changed;
  }

  /// Moves neighbours aside for units that still have none of their wished poses.
  void MakeRoom() {
    for (std::uint32_t n = 0; n < units_.size(); ++n) {
      const ApproachWish& unit = units_[n];
      if (!unit.otherwise || unit.wished.empty() || *chosen_[n] != *unit.otherwise) continue;
      for (const Pose& pose : unit.wished)
        if (MakeRoomAt({n}, pose)) break;
    }
  }

  [[nodiscard]] std::vector<std::optional<Pose>> chosen() && { return std::move(chosen_); }

 private:
  [[nodiscard]] SegmentFp ArmOfUnit(PositionerIndex i, const Pose& pose) const {
    return ArmAt(layout_.unit(i), drives_[i.value], pose);
  }

  bool Improve(PositionerIndex i) {
    for (const Pose& pose : units_[i.value].wished) {
      if (pose == *chosen_[i.value]) return false;  // the poses after it are worse
      if (!HasRoom(i, ArmOfUnit(i, pose))) continue;
      Take(i, pose);
      return true;
    }
    return false;
  }

  void Take(PositionerIndex i, const Pose& pose) {
    chosen_[i.value] = pose;
    arms_[i.value] = ArmOfUnit(i, pose);
  }

  /// True: `i` is there now, and the units in its way are aside. False: nothing has changed.
  bool MakeRoomAt(PositionerIndex i, const Pose& pose) {
    constexpr std::size_t kAsideMost = 2;
    const SegmentFp arm = ArmOfUnit(i, pose);
    std::vector<PositionerIndex> in_the_way;
    for (const PositionerIndex j : layout_.neighbours(i))
      if (arms_[j.value] && !IsClear(layout_, {i, arm}, {j, *arms_[j.value]}, guard_mm_))
        in_the_way.push_back(j);
    if (in_the_way.empty() || in_the_way.size() > kAsideMost) return false;
    const Pose before = *chosen_[i.value];
    Take(i, pose);
    std::size_t gone = 0;
    while (gone < in_the_way.size() && MoveAside(in_the_way[gone])) ++gone;
    if (gone == in_the_way.size() && HasRoom(i, arm)) return true;
    for (std::size_t k = 0; k < gone; ++k)
      Take(in_the_way[k], *units_[in_the_way[k].value].otherwise);
    Take(i, before);
    return false;
  }

  /// Moves a unit aside, only from where it would stay.
  bool MoveAside(PositionerIndex j) {
    const ApproachWish& unit = units_[j.value];
    if (*chosen_[j.value] != *unit.otherwise) return false;
    for (const Pose& pose : unit.aside) {
      if (!HasRoom(j, ArmOfUnit(j, pose))) continue;
      Take(j, pose);
      return true;
    }
    return false;
  }

  [[nodiscard]] bool HasRoom(PositionerIndex i, const SegmentFp& arm) const {
    for (const PositionerIndex j : layout_.neighbours(i))
      if (arms_[j.value] && !IsClear(layout_, {i, arm}, {j, *arms_[j.value]}, guard_mm_))
        return false;
    return std::all_of(layout_.obstacles().begin(), layout_.obstacles().end(),
                       [&](const Obstacle& obstacle) {
                         return IsClear(layout_, {i, arm}, obstacle, guard_mm_);
                       });
  }

  const Layout& layout_;
  std::span<const UnitDrive> drives_;
  std::span<const ApproachWish> units_;
  double guard_mm_;
  std::vector<std::optional<Pose>> chosen_;
  std::vector<std::optional<SegmentFp>> arms_;
};

}  // namespace

std::vector<std::optional<Pose>> ChooseApproaches(const Layout& layout,
                                                  std::span<const UnitDrive> drives,
                                                  std::span<const ApproachWish> units,
                                                  double guard_mm) {
  constexpr int kPasses = 3;
  Chooser chooser(layout, drives, units, guard_mm);
  for (int pass = 0; pass < kPasses && chooser.Pass(); ++pass) {
  }
  chooser.MakeRoom();
  return std::move(chooser).chosen();
}

}  // namespace focalfleet
