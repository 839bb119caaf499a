#include "fleet/coordinate/run_up.h"

#include <algorithm>

#include "fleet/geometry/clearance.h"
#include "fleet/kinematics.h"

namespace focalfleet {
namespace {

class Chooser {
 public:
  Chooser(const Layout& layout, std::span<const UnitDrive> drives, std::span<const RunUp> units,
          double guard_mm)
      : layout_(layout), drives_(drives), units_(units), guard_mm_(guard_mm) {
    for (std::uint32_t n = 0; n < units.size(); ++n) {
      chosen_.push_back(units[n].otherwise);
      arms_.push_back(units[n].otherwise ? std::optional(ArmOfUnit({n}, *units[n].otherwise))
                                         : std::nullopt);
    }
  }

  /// Whether anybody got more than it had.
  bool Pass() {
    bool changed = false;
    for (std::uint32_t n = 0; n < units_.size(); ++n)
      changed |= units_[n].otherwise && Improve({n});
    return changed;
  }

  [[nodiscard]] std::vector<std::optional<Pose>> chosen() && { return std::move(chosen_); }

 private:
  [[nodiscard]] SegmentFp ArmOfUnit(PositionerIndex i, const Pose& pose) const {
    return ArmAt(layout_.unit(i), drives_[i.value], pose);
  }

  bool Improve(PositionerIndex i) {
    for (const Pose& pose : units_[i.value].wished) {
      if (pose == *chosen_[i.value]) return false;  // what comes after is worse
      const SegmentFp arm = ArmOfUnit(i, pose);
      if (!HasRoom(i, arm)) continue;
      chosen_[i.value] = pose;
      arms_[i.value] = arm;
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
  std::span<const RunUp> units_;
  double guard_mm_;
  std::vector<std::optional<Pose>> chosen_;
  std::vector<std::optional<SegmentFp>> arms_;
};

}  // namespace

std::vector<std::optional<Pose>> ChooseRunUps(const Layout& layout,
                                              std::span<const UnitDrive> drives,
                                              std::span<const RunUp> units, double guard_mm) {
  constexpr int kPasses = 3;
  Chooser chooser(layout, drives, units, guard_mm);
  for (int pass = 0; pass < kPasses && chooser.Pass(); ++pass) {
  }
  return std::move(chooser).chosen();
}

}  // namespace focalfleet
