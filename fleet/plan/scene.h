// The setting of a plan: every unit's arm and cell, the distance that each pair of neighbours must
// keep, and the things that never move.
//
// Cells. A cell is a disc around the base, so small that an arm inside its own cell is clear of
// every arm inside another. Half-width and clearance are taken off the distance of two bases, and
// the rest is shared. A unit whose elbow needs more than its half gets more, as long as its
// neighbours can spare it. Where that fails the unit has no cell (radius 0) and cannot be moved by
// cells.
//
// Needs. A pair is planned with the full distance and a guard against rounding. Where the two start
// or end nearer than that (the rule allows 2 um less), the pair's need is lowered to just below
// that distance.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fleet/geometry/arm.h"
#include "fleet/knowledge.h"
#include "fleet/layout.h"
#include "fleet/plan/bundles.h"
#include "fleet/plan/track.h"

namespace focalfleet {

inline constexpr std::uint32_t kNoUnitIndex = 0xffffffffu;
/// Two units count as clear that are up to this much nearer than half-widths plus clearance.
inline constexpr double kClearToleranceMm = 2e-3;

struct NeighbourNeed {
  std::uint32_t unit = 0;
  double need_mm = 0;  // segments of the two must be farther apart than this
  /// The need while both still are where they start; smaller only where they are to be led apart.
  double at_start_mm = 0;
};

/// Something that never moves, seen from one unit.
struct StandingThing {
  Capsule capsule;
  double need_mm = 0;
  double least_mm = 0;              // the least that the rule asks
  std::uint32_t by = kNoUnitIndex;  // the unit that it stands for; kNoUnitIndex: a fixed obstacle
  bool in_cell = false;             // that unit is in its cell at any of its possible places
};

/// Whole vectors of phi, both ends included; empty where low > high.
struct PhiSpan {
  std::int32_t low = 0;
  std::int32_t high = -1;
};

class Scene {
 public:
  Scene(const Layout& layout, std::span<const UnitDrive> drives,
        std::span<const UnitKnowledge> start, std::span<const Pose> offsets = {});

  [[nodiscard]] std::size_t size() const { return arms_.size(); }
  [[nodiscard]] const Layout& layout() const { return *layout_; }
  [[nodiscard]] const ArmGeometry& arm(std::uint32_t unit) const { return arms_[unit]; }
  [[nodiscard]] std::span<const NeighbourNeed> neighbours(std::uint32_t unit) const {
    return {needs_.data() + needs_begin_[unit], needs_begin_[unit + 1] - needs_begin_[unit]};
  }
  /// Fixed obstacles in reach, and covers of all poses that units of uncertain place may have.
  [[nodiscard]] std::span<const StandingThing> standing(std::uint32_t unit) const {
    return {standing_.data() + standing_begin_[unit],
            standing_begin_[unit + 1] - standing_begin_[unit]};
  }
  /// The values of phi around "folded back" for which the arm is inside its cell, whatever theta.
  [[nodiscard]] const PhiSpan& cell(std::uint32_t unit) const { return cells_[unit]; }
  [[nodiscard]] bool HasCell(std::uint32_t unit) const {
    return cells_[unit].low <= cells_[unit].high;
  }
  [[nodiscard]] bool InCell(std::uint32_t unit, const PoseBox& box) const {
    return cells_[unit].low <= box.low[1] && box.high[1] <= cells_[unit].high;
  }
  [[nodiscard]] bool InCell(std::uint32_t unit, const Pose& pose) const {
    return InCell(unit, PoseBox::Of(pose));
  }
  [[nodiscard]] bool is_place(std::uint32_t unit) const { return is_place_[unit] != 0; }

  /// The motion passes clear of all standing things of the unit. `met` is looked at first, and is
  /// the one that is met where there is one: the next motion is likely to meet the same.
  [[nodiscard]] bool PassesClearOfStanding(std::uint32_t unit, const Track& track,
                                           std::uint32_t* met) const;

  /// Half-widths and clearance of a pair, exactly as the rule says.
  [[nodiscard]] double FullNeed(std::uint32_t a, std::uint32_t b) const {
    return arms_[a].half_width_mm() + arms_[b].half_width_mm() + layout_->clearance_mm();
  }
  /// Lowers the needs of pairs that stand nearer than planned needs in this configuration, by no
  /// more than the rule's tolerance.
  void AllowFor(std::span<const Pose> poses);
  /// From now on pairs that start nearer than the rule allows may leave each other. On the first
  /// way of either they are never brought nearer. Pairs that cross are not helped. Shape: (n), the
  /// starts.
  void LeadApart(std::span<const Pose> poses);
  /// The same for plans without a first way: such pairs are never nearer than they start.
  void LeadApartThroughout(std::span<const Pose> poses);

 private:
  void FindCells();
  void FindStanding(std::span<const UnitKnowledge> start);

  const Layout* layout_;
  std::vector<ArmGeometry> arms_;
  std::vector<PhiSpan> cells_;
  std::vector<std::uint8_t> is_place_;
  std::vector<std::uint32_t> needs_begin_;
  std::vector<NeighbourNeed> needs_;
  std::vector<std::uint32_t> standing_begin_;
  std::vector<StandingThing> standing_;
  std::vector<std::vector<Bundle>> bundles_;  // of the standing things of each unit
};

/// Capsules that cover the arm in every pose of the box, each at most `slack_mm` too wide where 400
/// of them are enough for that.
std::vector<Capsule> CoverOf(const ArmGeometry& arm, const PoseBox& box, double slack_mm);

/// The box of all poses that this knowledge allows.
PoseBox BoxOf(const ArmGeometry& arm, const UnitKnowledge& knowledge);

}  // namespace focalfleet
