// The choice of approaches gives each unit a pose to approach its target from, clear of all others.
// The choice is greedy and in order. A unit without room for its best pose takes the next one, or
// stays, and is tried again when its neighbours have chosen. For a unit that finds no room at all,
// neighbours are moved aside where they can be. Cost: a few arm distances a unit and neighbour.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "fleet/drive.h"
#include "fleet/layout.h"

namespace focalfleet {

struct ApproachWish {
  std::optional<Pose> otherwise;  // where it ends without one; none: not known, not considered
  std::vector<Pose> wished;       // the best first; empty: it stays with `otherwise`
  std::vector<Pose> aside = {};   // where it is moved to make room for another, and only then
};

/// A pose for each unit: one of `wished`, of `aside`, or `otherwise`. Each new pose is clear of all
/// others by the layout's clearance and `guard_mm`.
std::vector<std::optional<Pose>> ChooseApproaches(const Layout& layout,
                                                  std::span<const UnitDrive> drives,
                                                  std::span<const ApproachWish> units,
                                                  double guard_mm);

}  // namespace focalfleet
