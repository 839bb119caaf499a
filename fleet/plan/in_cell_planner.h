// Between the ways in and out every mover turns inside its cell, from where it came in to where it
// will go out from. Cells are clear of each other, so all this concerns only what stands across a
// cell: obstacles, and units that do not move.
//
// Movers "by themselves" have no way through their cells. They stand at their starts while the
// others come in. They go to their targets in one way here, while all others are in their cells,
// and stand there while the others go out.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "fleet/plan/scene.h"
#include "fleet/plan/sequential_planner.h"

namespace focalfleet {

class InCellPlanner {
 public:
  /// `from` is where each unit stands after the way in, `to` before the way out. Shape: (n).
  InCellPlanner(const Scene* scene, std::span<const UnitDrive> drives, Surroundings* surroundings,
                std::span<const Pose> from, std::span<const Pose> to);
  void Run();

  [[nodiscard]] const std::vector<Piece>& pieces() const { return pieces_; }
  /// Units that found no way; ascending.
  [[nodiscard]] const std::vector<std::uint32_t>& stuck() const { return pending_; }

 private:
  bool Pass(bool in_cell);
  [[nodiscard]] Way WayOf(std::uint32_t unit, bool in_cell);

  const Scene* scene_;
  std::span<const UnitDrive> drives_;
  Surroundings* surroundings_;
  std::vector<Pose> poses_;
  std::vector<SegmentFp> lines_;
  std::span<const Pose> to_;
  std::vector<std::uint32_t> pending_;
  std::vector<Piece> pieces_;
};

}  // namespace focalfleet
